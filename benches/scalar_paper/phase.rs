//! Wrapped phase (2.1), and that of C2 along its epipolar lines.

use std::f32::consts::TAU;

use super::TURN;

/// Least modulation, grey levels; largest residual of the sinusoid in it.
const MIN_MODULATION: f32 = 5.0;
const MAX_RESIDUAL: f32 = 1.0;
/// Difference of neighbours that belong to one surface, and of the differences on opposite sides of four pixels,
/// turns · 65536.
pub(super) const MAX_STEP: i32 = 24576;
const MAX_TWIST: i32 = 6000;

/// Wrapped phase, turns · 65536, and where there is one.
pub(super) struct Phases {
    pub(super) phase: Vec<u16>,
    pub(super) valid: Vec<bool>,
}

/// Difference of two phases, −½ to ½ turn.
pub(super) fn difference(a: u16, b: u16) -> i32 {
    i32::from(a.wrapping_sub(b) as i16)
}

impl Phases {
    /// φ = atan2(−Σ I sin s, Σ I cos s).
    pub(super) fn decode(images: &[&[u8]], shifts_rad: &[f64]) -> Self {
        let steps = images.len() as f32;
        let waves: Vec<(f32, f32)> = shifts_rad.iter().map(|s| (s.sin() as f32, s.cos() as f32)).collect();
        let pixels = images[0].len();
        let mut all = Self { phase: vec![0; pixels], valid: vec![false; pixels] };
        for i in 0..pixels {
            let (mut offset, mut sine, mut cosine) = (0.0, 0.0, 0.0);
            for (image, (sin, cos)) in images.iter().zip(&waves) {
                let grey = f32::from(image[i]);
                offset += grey / steps;
                sine -= 2.0 / steps * grey * sin;
                cosine += 2.0 / steps * grey * cos;
            }
            let mut squares = 0.0;
            for (image, (sin, cos)) in images.iter().zip(&waves) {
                squares += (f32::from(image[i]) - offset - cosine * cos + sine * sin).powi(2);
            }
            let residual = (squares / (steps - 3.0)).sqrt();
            let modulation = sine.hypot(cosine);
            all.phase[i] = (sine.atan2(cosine) / TAU * TURN as f32).round() as i32 as u16;
            all.valid[i] = modulation >= MIN_MODULATION && residual <= MAX_RESIDUAL * modulation;
        }
        all
    }

    /// The phase at every pixel of the epipolar frame: bilinear where four pixels show one surface, else that of the nearest.
    pub(super) fn resampled(&self, width: usize, sources: &[Option<(usize, [f32; 2])>]) -> Self {
        let mut all = Self { phase: vec![0; sources.len()], valid: vec![false; sources.len()] };
        for (i, source) in sources.iter().enumerate() {
            let Some((first, [right, below])) = *source else { continue };
            let corners = [first, first + 1, first + width, first + width + 1];
            let [upper_left, upper_right, lower_left, lower_right] = corners.map(|corner| self.phase[corner]);
            let (top, bottom) = (difference(upper_right, upper_left), difference(lower_right, lower_left));
            let (at_left, at_right) = (difference(lower_left, upper_left), difference(lower_right, upper_right));
            let is_smooth = corners.iter().all(|&corner| self.valid[corner])
                && [top, bottom, at_left, at_right].iter().all(|step| step.abs() <= MAX_STEP)
                && (top - bottom).abs() <= MAX_TWIST
                && (at_left - at_right).abs() <= MAX_TWIST;
            if is_smooth {
                let [top, bottom, at_left] = [top, bottom, at_left].map(|step| step as f32);
                let mixed = top * right * (1.0 - below) + (at_left + bottom * right) * below;
                all.phase[i] = upper_left.wrapping_add(mixed.round() as i32 as u16);
                all.valid[i] = true;
            } else {
                let nearest = corners[usize::from(right >= 0.5) + 2 * usize::from(below >= 0.5)];
                (all.phase[i], all.valid[i]) = (self.phase[nearest], self.valid[nearest]);
            }
        }
        all
    }
}
