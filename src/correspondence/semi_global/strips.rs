//! Strips: regions of wrong orders, recognized by the shape of δ over them.
//!
//! ```text
//! for each region of selected candidates, z = (δ − drift)/sd:
//!     fit a plane to z over its pixels: R² is the share of the variance of z that it explains
//!     count its left and right ends, and those beyond which the wrapped phase of C1 continues
//!     it is a strip if R² is large, z scatters more than noise does, and it ends where the phase continues
//! ```
//!
//! Over a true surface δ scatters about the drift. Over a surface whose true order was not searched, or is hidden from
//! C2, δ of a wrong order runs through zero. Candidates are selected where it passes by, and end on either side
//! although the surface continues.
//!
//! At rest the plane explains a strip but for noise. On a curved surface δ follows the slope instead, where the epipolar
//! lines of the calibration are off, and the less noise there is, the more of that stands out.

use crate::correspondence::regions::Regions;
use crate::correspondence::runs::Run;
use crate::correspondence::surfaces;

/// Fewest pixels of a region with a meaningful shape.
const MIN_PIXELS: f64 = 10.0;
/// R² and sd of z beyond which δ runs through a region. True regions have R² up to 0.3, and an sd of one unless the
/// drift fits them badly.
const MIN_R2: f64 = 0.45;
const MIN_SD: f64 = 1.33;
/// Smaller limits suffice if the phase continues beyond both sides.
const MIN_R2_OF_OPEN: f64 = 0.3;
const MIN_SD_OF_OPEN: f64 = 1.05;
/// Variance of z that a plane may leave of such a strip at rest, unless z scatters by more than it may over a surface.
/// Measured over teeth in 16 images: 2.3 to 4.4 with an sd of 1.9 to 2.6; over strips 0.4 to 1.7. Motion scatters z over
/// both.
const MAX_VARIANCE_LEFT: f64 = 1.8;
const MAX_SD_OF_CURVED: f64 = 3.4;
/// Share of the ends on a side beyond which the phase continues.
const OPEN_SHARE: f64 = 0.5;
const WIDE_OPEN_SHARE: f64 = 0.6;
/// Share of the image from which a region is large: then both sides must be open.
const LARGE_SHARE: f64 = 1.0 / 160.0;
/// Unit of places in the image, pixels: it keeps the sums of squares small.
const PLACE_PX: f64 = 64.0;

/// Sums over the pixels of a region.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: f64,
    u: f64,
    v: f64,
    z: f64,
    uu: f64,
    vv: f64,
    uv: f64,
    uz: f64,
    vz: f64,
    zz: f64,
    /// Ends on the left and on the right, and those beyond which the phase continues.
    ends: [f64; 2],
    open: [f64; 2],
}

/// The shape of each region.
#[derive(Clone, Debug, Default)]
pub(super) struct Strips {
    moments: Vec<Moments>,
    /// Whether a region is a strip.
    pub(super) is_strip: Vec<bool>,
}

impl Strips {
    /// Finds the strips among the regions, from z of all pixels of an image of `width` columns. `at_rest` is true if the
    /// scene does not move.
    pub(super) fn find(
        &mut self,
        width: usize,
        regions: &Regions,
        z: &[f32],
        surfaces: &surfaces::Scratch,
        at_rest: bool,
    ) {
        let Self { moments, is_strip } = self;
        moments.clear();
        moments.resize(regions.count(), Moments::default());
        for run in &regions.runs.all {
            moments[run.set as usize].add(width, run, z, surfaces);
        }
        let large = LARGE_SHARE * z.len() as f64;
        is_strip.clear();
        is_strip.extend(moments.iter().map(|moments| moments.is_strip(large, at_rest)));
    }
}

impl Moments {
    fn add(&mut self, width: usize, run: &Run, z: &[f32], surfaces: &surfaces::Scratch) {
        let pixels = run.pixels();
        let (row, begin) = (pixels.start / width, pixels.start % width);
        let count = pixels.len() as f64;
        let (v, first) = (row as f64 / PLACE_PX, begin as f64 / PLACE_PX);
        // The sums over places have a closed form; z is summed with places counted from the first pixel.
        let (last, per_px) = (count - 1.0, 1.0 / PLACE_PX);
        let (places, squares) =
            (0.5 * last * count * per_px, last * count * (2.0 * last + 1.0) / 6.0 * per_px * per_px);
        let (mut sum, mut along, mut square) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (i, &z) in z[pixels].iter().enumerate() {
            let z = f64::from(z);
            sum += z;
            along += i as f64 * z;
            square += z * z;
        }
        let u = count * first + places;
        self.count += count;
        self.u += u;
        self.v += count * v;
        self.z += sum;
        self.uu += count * first * first + 2.0 * first * places + squares;
        self.vv += count * v * v;
        self.uv += u * v;
        self.uz += first * sum + along * per_px;
        self.vz += v * sum;
        self.zz += square;
        self.ends = self.ends.map(|ends| ends + 1.0);
        for (open, end) in self.open.iter_mut().zip([run.pixels().start, run.pixels().end]) {
            *open += f64::from(u8::from(surfaces.continues_to(row, end)));
        }
    }

    fn is_strip(&self, large: f64, at_rest: bool) -> bool {
        if self.count < MIN_PIXELS {
            return false;
        }
        // Second moments about the means.
        let about = |sum: f64, a: f64, b: f64| sum - a * b / self.count;
        let (uu, vv, uv) =
            (about(self.uu, self.u, self.u), about(self.vv, self.v, self.v), about(self.uv, self.u, self.v));
        let (uz, vz, zz) =
            (about(self.uz, self.u, self.z), about(self.vz, self.v, self.z), about(self.zz, self.z, self.z));
        let determinant = uu * vv - uv * uv;
        // A region along a line has a slope instead of a plane.
        let explained = if determinant > 1e-6 * uu * vv && determinant > 0.0 {
            ((uz * vv - vz * uv) * uz + (vz * uu - uz * uv) * vz) / determinant
        } else {
            [(uz, uu), (vz, vv)]
                .map(|(z, place)| if place > 0.0 { z * z / place } else { 0.0 })
                .into_iter()
                .fold(0.0, f64::max)
        };
        let (r2, sd) = (explained / zz.max(f64::MIN_POSITIVE), (zz.max(0.0) / self.count).sqrt());
        let share = |side: usize| self.open[side] / self.ends[side].max(1.0);
        let is_open = |side: usize| share(side) > OPEN_SHARE;
        let is_wide_open = (0..2).all(|side| share(side) > WIDE_OPEN_SHARE);
        // A surface ends where its phase does. A region that ends elsewhere ends because δ failed the test.
        let is_bounded_wrongly = if self.count > large { is_wide_open } else { is_open(0) || is_open(1) };
        let runs_through = r2 > MIN_R2 && sd > MIN_SD && is_bounded_wrongly;
        let is_curved = at_rest && (1.0 - r2) * sd * sd > MAX_VARIANCE_LEFT && sd < MAX_SD_OF_CURVED;
        let runs_evenly = r2 > MIN_R2_OF_OPEN && sd > MIN_SD_OF_OPEN && !is_curved;
        runs_through || (is_wide_open && runs_evenly && self.count <= large)
    }
}
