//! Draws the histogram of δ, with the threshold.

use std::f32::consts::PI;

use super::colour::{BACKGROUND, INK, INVALID, MUTED, ORANGE, SKY_BLUE};
use super::font::{draw_text, text_size};
use super::picture::Picture;

const SIZE: [usize; 2] = [960, 480];
/// Top left corner of the plot, and its size. A bin is [`BAR`] wide.
const PLOT: [usize; 2] = [80, 48];
const PLOT_SIZE: [usize; 2] = [840, 360];
const BAR: usize = 3;
const BINS: usize = PLOT_SIZE[0] / BAR;
const SCALE: usize = 2;

/// Draws the histogram of δ over (−π, π], with counts on a logarithmic axis. Bins within ±`thr_rad` are blue.
///
/// True correspondences make a peak at 0, false candidates a floor. Values outside (−π, π] and NaN are skipped.
#[must_use]
pub fn delta_histogram_picture(deltas_rad: &[f32], thr_rad: f32) -> Picture {
    let counts = histogram(deltas_rad);
    let mut picture = Picture::filled(SIZE, BACKGROUND);
    let decades = decades(&counts);
    draw_grid(&mut picture, decades);
    for (bin, &count) in counts.iter().enumerate() {
        let accepted = centre_rad(bin).abs() <= thr_rad;
        let height = bar_height(count, decades);
        let corner = [PLOT[0] + bin * BAR, PLOT[1] + PLOT_SIZE[1] - height];
        picture.fill(corner, [BAR, height], if accepted { SKY_BLUE } else { MUTED });
    }
    draw_threshold(&mut picture, deltas_rad, thr_rad);
    picture
}

fn histogram(deltas_rad: &[f32]) -> [u64; BINS] {
    let mut counts = [0; BINS];
    for &delta in deltas_rad.iter().filter(|d| d.abs() <= PI) {
        let bin = (delta + PI) / (2.0 * PI) * BINS as f32;
        counts[(bin as usize).min(BINS - 1)] += 1;
    }
    counts
}

fn centre_rad(bin: usize) -> f32 {
    (bin as f32 + 0.5) / BINS as f32 * 2.0 * PI - PI
}

/// Returns the number of decades that the largest count needs.
fn decades(counts: &[u64]) -> u32 {
    counts.iter().max().map_or(1, |&most| most.max(1).ilog10() + 1)
}

/// Returns the height of a bar. A count of 1 is a tenth of a decade high, so that it is visible; 10^`decades` fills the
/// plot.
fn bar_height(count: u64, decades: u32) -> usize {
    if count == 0 {
        return 0;
    }
    let share = ((count as f32).log10() + 0.1) / (decades as f32 + 0.1);
    (share * PLOT_SIZE[1] as f32).round() as usize
}

fn draw_grid(picture: &mut Picture, decades: u32) {
    let bottom = PLOT[1] + PLOT_SIZE[1];
    for decade in 0..=decades {
        let count = 10_u64.saturating_pow(decade);
        let top = bottom - bar_height(count, decades);
        picture.fill([PLOT[0], top], [PLOT_SIZE[0], 1], INVALID);
        let label = short_count(count);
        let [width, height] = text_size(&label, SCALE);
        draw_text(picture, [PLOT[0] - 10 - width, top - height / 2 + 1], &label, SCALE, MUTED);
    }
    for tick in -3_i8..=3 {
        let u = column_of(f32::from(tick));
        picture.fill([u, bottom], [1, 8], MUTED);
        draw_centred(picture, [u, bottom + 14], &tick.to_string());
    }
    draw_centred(picture, [PLOT[0] + PLOT_SIZE[0] / 2, bottom + 40], "δ in rad");
}

fn draw_centred(picture: &mut Picture, [centre, top]: [usize; 2], text: &str) {
    let left = centre - text_size(text, SCALE)[0] / 2;
    draw_text(picture, [left, top], text, SCALE, MUTED);
}

/// Draws dashed lines at ±thr, and the share of values between them.
fn draw_threshold(picture: &mut Picture, deltas_rad: &[f32], thr_rad: f32) {
    for u in [-thr_rad, thr_rad].map(column_of) {
        for v in (PLOT[1]..PLOT[1] + PLOT_SIZE[1]).step_by(10) {
            picture.fill([u, v], [2, 6], ORANGE);
        }
    }
    let inside = deltas_rad.iter().filter(|d| d.abs() <= thr_rad).count();
    let percent = inside as f64 / deltas_rad.len().max(1) as f64 * 100.0;
    let text = format!("thr ± {thr_rad:.3} rad");
    draw_text(picture, [PLOT[0], 16], &text, SCALE, ORANGE);
    let left = PLOT[0] + text_size(&text, SCALE)[0] + 40;
    draw_text(picture, [left, 16], &format!("within {percent:.1} %"), SCALE, INK);
}

/// Returns the column of a δ. Values beyond the axis go to its ends.
fn column_of(delta_rad: f32) -> usize {
    let share = ((delta_rad + PI) / (2.0 * PI)).clamp(0.0, 1.0);
    PLOT[0] + (share * PLOT_SIZE[0] as f32).round() as usize
}

/// Formats a power of ten, with k for thousand and m for million.
fn short_count(count: u64) -> String {
    match count {
        0..1_000 => count.to_string(),
        1_000..1_000_000 => format!("{}k", count / 1_000),
        _ => format!("{}m", count / 1_000_000),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count_of(picture: &Picture, colour: [u8; 3]) -> usize {
        picture.pixels().iter().filter(|&&p| p == colour).count()
    }

    #[test]
    fn every_finite_delta_lands_in_the_bin_around_it() {
        for bin in 0..BINS {
            assert_eq!(histogram(&[centre_rad(bin)])[bin], 1);
        }
        let counts = histogram(&[-PI, PI, f32::NAN, f32::INFINITY, 4.0]);
        assert_eq!((counts[0], counts[BINS - 1], counts.iter().sum::<u64>()), (1, 1, 2));
    }

    #[test]
    fn the_tallest_bar_fits_the_plot_and_a_single_count_is_visible() {
        for most in [1, 9, 10, 11, 999, 1_000_000] {
            let decades = decades(&[most]);
            assert!(bar_height(most, decades) <= PLOT_SIZE[1]);
            assert!(bar_height(1, decades) > 3);
        }
    }

    #[test]
    fn a_wider_threshold_lets_more_through() {
        let deltas: Vec<f32> = (0..1000).map(|i| i as f32 / 1000.0 - 0.5).collect();
        let [narrow, wide] = [0.1, 0.4].map(|thr| delta_histogram_picture(&deltas, thr));
        assert_eq!(narrow.size_px(), SIZE);
        assert!(count_of(&wide, SKY_BLUE) > 3 * count_of(&narrow, SKY_BLUE));
        assert!(count_of(&narrow, MUTED) > count_of(&wide, MUTED));
    }

    #[test]
    fn empty_input_and_odd_thresholds_make_a_picture() {
        for thr in [0.0, f32::NAN, f32::INFINITY, -1.0] {
            assert_eq!(delta_histogram_picture(&[], thr).size_px(), SIZE);
        }
    }
}
