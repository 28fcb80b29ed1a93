//! The projector's coordinates at each pixel of a camera, from phase and Gray code of both directions.

use fringeflow::phase::{PhaseMap, Threshold, Validity, decode, decode_gray_code};
use fringeflow_dataset::GreyImage;

use super::order::{CodedFringes, PatternOrder};

/// Projector coordinates of one direction at each pixel of a camera, row by row.
pub(crate) struct Coordinates {
    pub(crate) phase: PhaseMap,
    /// Column or row of the projector, pixels; meaningless where not valid.
    position_px: Vec<f32>,
    valid: Vec<bool>,
}

impl Coordinates {
    /// Decodes one direction; `None` if the images have different sizes.
    pub(crate) fn decode(images: &[GreyImage], order: &PatternOrder, direction: &CodedFringes) -> Option<Self> {
        let first = images.first()?;
        let levels = |indices: &[usize]| indices.iter().map(|&i| images[i].levels()).collect::<Vec<_>>();
        let fringes = levels(&direction.fringes);
        let phase = decode(&fringes, first.width, first.height, &direction.shifts, &Validity::default())?;
        let threshold = match (order.white.first(), order.black) {
            (Some(&white), Some(black)) => Threshold::WhiteAndBlack(images[white].levels(), images[black].levels()),
            _ => Threshold::MeanOfPhaseImages,
        };
        let (code, bits) = (&direction.code, levels(&direction.bits));
        let absolute =
            decode_gray_code(&phase, &direction.pattern, code, &bits, threshold, phase.fit.noise_grey).ok()?;
        let position = |&turns: &f32| direction.pattern.column_px(f64::from(turns)) as f32;
        Some(Self { position_px: absolute.turns.iter().map(position).collect(), valid: absolute.valid, phase })
    }

    /// Share of the pixels with a phase whose Gray code determines the fringe order.
    pub(crate) fn coded_share(&self) -> f64 {
        let count = |valid: &[bool]| valid.iter().filter(|&&valid| valid).count();
        count(&self.valid) as f64 / count(&self.phase.valid).max(1) as f64
    }

    /// The coordinate at a pixel, pixels of the projector, with its modulation, grey levels.
    pub(crate) fn at(&self, pixel: usize) -> Option<(f64, f64)> {
        let modulation = f64::from(self.phase.modulation[pixel].grey());
        self.valid[pixel].then(|| (f64::from(self.position_px[pixel]), modulation))
    }
}
