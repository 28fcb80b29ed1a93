//! Wrapped phase (2.1), and that of C2 along its epipolar lines.

use std::f32::consts::TAU;

/// Least modulation, grey levels; largest residual of the sinusoid in it.
const MIN_MODULATION: f32 = 5.0;
const MAX_RESIDUAL: f32 = 1.0;
/// Difference of neighbours that belong to one surface, turns, and of the differences on opposite sides of four pixels.
pub(super) const MAX_STEP: f32 = 0.375;
const MAX_TWIST: f32 = 0.092;

/// Wrapped phase in turns from 0 to 1, and where there is one.
pub(super) struct Phases {
    pub(super) phase: Vec<f32>,
    pub(super) valid: Vec<bool>,
}

/// Difference of two phases, −½ to ½ turn.
pub(super) fn wrapped(turns: f32) -> f32 {
    turns - turns.round()
}

impl Phases {
    /// φ = atan2(−Σ I sin s, Σ I cos s).
    pub(super) fn decode(images: &[&[u8]], shifts_rad: &[f64]) -> Self {
        let steps = images.len() as f32;
        let waves: Vec<(f32, f32)> = shifts_rad.iter().map(|s| (s.sin() as f32, s.cos() as f32)).collect();
        let pixels = images[0].len();
        let mut all = Self { phase: vec![0.0; pixels], valid: vec![false; pixels] };
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
            all.phase[i] = (sine.atan2(cosine) / TAU).rem_euclid(1.0);
            all.valid[i] = modulation >= MIN_MODULATION && residual <= MAX_RESIDUAL * modulation;
        }
        all
    }

    /// The phase at every pixel of the epipolar frame: bilinear where four pixels show one surface, else that of the nearest.
    pub(super) fn resampled(&self, width: usize, sources: &[Option<(usize, [f32; 2])>]) -> Self {
        let mut all = Self { phase: vec![0.0; sources.len()], valid: vec![false; sources.len()] };
        for (i, source) in sources.iter().enumerate() {
            let Some((first, [right, below])) = *source else { continue };
            let corners = [first, first + 1, first + width, first + width + 1];
            let [upper_left, upper_right, lower_left, lower_right] = corners.map(|corner| self.phase[corner]);
            let (top, bottom) = (wrapped(upper_right - upper_left), wrapped(lower_right - lower_left));
            let (at_left, at_right) = (wrapped(lower_left - upper_left), wrapped(lower_right - upper_right));
            let is_smooth = corners.iter().all(|&corner| self.valid[corner])
                && [top, bottom, at_left, at_right].iter().all(|step| step.abs() <= MAX_STEP)
                && (top - bottom).abs() <= MAX_TWIST
                && (at_left - at_right).abs() <= MAX_TWIST;
            if is_smooth {
                let mixed = top * right * (1.0 - below) + (at_left + bottom * right) * below;
                all.phase[i] = (upper_left + mixed).rem_euclid(1.0);
                all.valid[i] = true;
            } else {
                let nearest = corners[usize::from(right >= 0.5) + 2 * usize::from(below >= 0.5)];
                (all.phase[i], all.valid[i]) = (self.phase[nearest], self.valid[nearest]);
            }
        }
        all
    }
}
