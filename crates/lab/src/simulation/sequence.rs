//! Simulates a whole fringe sequence of the virtual scanner, as a dataset folder.

use std::path::Path;

use serde_json::json;

use fringeflow::calibration::Unit;
use fringeflow::correspondence::{SegmentTable, SegmentTableError};
use fringeflow::geometry::Readout;
use fringeflow::phase::GrayCode;
use fringeflow_base::false_candidates::expected_false_candidates;
use fringeflow_base::grey::PixelFormat;
use fringeflow_dataset::{
    CameraId, DatasetDescription, DatasetWriter, FringeSequence, GreyImage, ImageKind, Motion, RenderedTruth,
};
use fringeflow_patterns::{Direction, Pattern, even_shifts_rad};
use fringeflow_pixels::DeviceImages;

use super::motion::ObjectMotion;
use super::packing::packed;
use super::sensor::{ImageSeed, NoiseLevel, Sensor};
use super::view::View;
use super::{
    Board, CalibrationDeviation, Object, RigOptions, Scene, SimulationError, Staging, VirtualRig, check_range,
    covered_camera, device, image_share, truth,
};

/// Options of a simulated dataset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulationOptions {
    /// The object.
    pub object: Object,
    /// The board.
    pub board: Board,
    /// The rig, with the seed of its calibration error.
    pub rig: RigOptions,
    /// Phase shifts per direction, 3 to 16.
    pub steps: usize,
    /// Whether there are also fringes and code along the rows of the projector.
    pub two_directions: bool,
    /// Whether there is Gray code.
    pub gray: bool,
    /// Whether there are a fully lit and an unlit image, from which Gray code gets its threshold. Without them the mean
    /// of the phase images is the threshold, as in the paper's sequences.
    pub white_and_black: bool,
    /// Noise of the cameras.
    pub noise: NoiseLevel,
    /// Side of the squares of pixels that the cameras sum to one pixel of the rig: 1 if its pixels are those of the
    /// sensor. Light and noise add up.
    pub binning: usize,
    /// Format and arrangement of the images.
    pub images: DeviceImages,
    /// Exponent of the projector, 1 for a linear one.
    pub gamma: f64,
    /// Exposure of the cameras, relative to one in which bright parts in the middle of the volume do not saturate.
    pub exposure: f64,
    /// Samples along each side of a pixel, 1 to 4.
    pub supersampling: usize,
    /// Seed of the noise.
    pub seed: u64,
}

impl SimulationOptions {
    /// The defaults of `fringeflow simulate` for an object.
    #[must_use]
    pub fn usual(object: Object) -> Self {
        Self {
            object,
            board: object.usual_board(),
            rig: RigOptions::usual(object.usual_depth_m()),
            steps: 8,
            two_directions: false,
            gray: true,
            white_and_black: true,
            noise: NoiseLevel::Normal,
            binning: 1,
            images: DeviceImages::default(),
            gamma: 1.0,
            exposure: 1.0,
            supersampling: 2,
            seed: 1,
        }
    }
}

/// Figures of a simulated dataset.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SimulationSummary {
    /// Images per camera.
    pub images: usize,
    /// Pixels of C1 that can be measured.
    pub measurable: usize,
    /// Mean number of fringe periods on an epipolar segment, n of Eq. 1 of the paper.
    pub mean_periods: f64,
    /// Expected false candidates per true one: Eq. 1 of the paper with the sd of the calibration error.
    pub expected_false_candidates: f64,
    /// Place of the projector along the base.
    pub projector_place: f64,
    /// Size of the calibration error.
    pub calibration_error: CalibrationDeviation,
}

/// A simulated sequence. Its rays are traced, so its images can be taken.
#[derive(Clone)]
pub struct Simulation {
    options: SimulationOptions,
    staging: Staging,
    /// Motion of the object from phase image to phase image.
    motion: Option<ObjectMotion>,
    rig: VirtualRig,
    /// The scene of the truth. For a moving object, this is the scene in the middle of its phase images.
    scene: Scene,
    views: [View; 2],
    truth: RenderedTruth,
}

/// Unit of simulated datasets.
pub(super) const UNIT: Unit = Simulation::TRUTH_UNIT;

impl Simulation {
    /// Unit of the points of the truth.
    pub const TRUTH_UNIT: Unit = Unit::Millimetre;

    /// Builds rig and scene, and traces the views of both cameras.
    ///
    /// # Errors
    /// [`SimulationError`]: an option is out of range.
    pub fn new(options: SimulationOptions) -> Result<Self, SimulationError> {
        Self::staged(options, Staging::default())
    }

    /// As [`Self::new`], with obstacles, or with the object shifted, scaled or moving.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn staged(options: SimulationOptions, staging: Staging) -> Result<Self, SimulationError> {
        staging.check()?;
        check_range("the number of steps", options.steps as f64, 3.0, 16.0, "images")?;
        device::check(options.images, options.rig.size_px)?;
        check_range("gamma", options.gamma, 0.2, 5.0, "")?;
        check_range("exposure", options.exposure, 0.01, 100.0, "")?;
        let motion = staging.motion.map(|motion| ObjectMotion::new(motion, options.steps)).transpose()?;
        let rig = VirtualRig::new(&options.rig)?;
        let scene = scene(&options, &staging, &rig)?;
        let view = |camera| {
            let view = View::trace(&rig.exact, &scene, camera, options.supersampling)?;
            Ok::<_, SimulationError>(if staging.covered == Some(camera) { view.half_covered() } else { view })
        };
        let views = [view(CameraId::Cam1)?, view(CameraId::Cam2)?];
        let mut truth = truth(&rig.exact, &rig.exact_volume, &scene, &views[0], UNIT);
        if let Some(camera) = staging.covered {
            covered_camera::hide(&mut truth, camera, options.rig.size_px[0]);
        }
        Ok(Self { options, staging, motion, rig, scene, views, truth })
    }

    /// Its options.
    #[must_use]
    pub fn options(&self) -> &SimulationOptions {
        &self.options
    }

    /// The same scene, with another calibration error and other noise. Nothing is traced again.
    ///
    /// # Errors
    /// The calibration error is too large for this rig.
    pub fn with_seed(&self, seed: u64) -> Result<Self, SimulationError> {
        let rig = RigOptions { seed, ..self.options.rig };
        let options = SimulationOptions { rig, seed, ..self.options };
        Ok(Self { rig: VirtualRig::new(&options.rig)?, options, ..self.clone() })
    }

    /// The rig.
    #[must_use]
    pub fn rig(&self) -> &VirtualRig {
        &self.rig
    }

    /// The views of the cameras, C1 first. For a moving object, they are those in the middle of its phase images.
    #[must_use]
    pub fn views(&self) -> &[View; 2] {
        &self.views
    }

    /// The truth, with points in millimetres. Its reference is not limited to the points that Gray code finds.
    #[must_use]
    pub fn truth(&self) -> &RenderedTruth {
        &self.truth
    }

    /// Figures of the dataset.
    #[must_use]
    pub fn summary(&self) -> SimulationSummary {
        let mean_periods = self.rig.mean_periods();
        SimulationSummary {
            images: self.images().len(),
            measurable: self.truth.measurable.iter().filter(|&&m| m).count(),
            mean_periods,
            expected_false_candidates: expected_false_candidates(self.rig.deviation.delta_rms, mean_periods),
            projector_place: self.rig.exact.projector_place_on_base(),
            calibration_error: self.rig.deviation,
        }
    }

    /// Kinds and patterns of the images of a camera, in the order in which they are taken.
    #[must_use]
    pub fn images(&self) -> Vec<(ImageKind, Pattern)> {
        let mut images = self.direction(Direction::Columns, ImageKind::Phase, ImageKind::Gray);
        if self.options.two_directions {
            images.extend(self.direction(Direction::Rows, ImageKind::SecondPhase, ImageKind::SecondGray));
        }
        if self.options.white_and_black {
            images.extend([(ImageKind::White, Pattern::White), (ImageKind::Black, Pattern::Black)]);
        }
        images
    }

    /// Poses of the object in the phase images, if it moves.
    #[must_use]
    pub fn motion(&self) -> Option<Motion> {
        self.motion.as_ref().map(ObjectMotion::description)
    }

    /// Phase shifts of one cycle, rad.
    #[must_use]
    pub fn cycle_shifts_rad(&self) -> Vec<f64> {
        even_shifts_rad(self.options.steps)
    }

    /// The segment table of the calibrated rig.
    ///
    /// # Errors
    /// The rig has no epipolar frame, or no ray of C1 meets the volume.
    pub fn segment_table(&self) -> Result<SegmentTable, SegmentTableError> {
        SegmentTable::build(&self.rig.calibrated, &self.rig.volume, &self.rig.columns)
    }

    /// Takes a phase image of the first direction with grey pixels, as [`Self::write_images`] does.
    pub(crate) fn phase_image(&self, camera: CameraId, number: usize) -> Result<GreyImage, SimulationError> {
        let shifts_rad = self.cycle_shifts_rad();
        let shift_rad = shifts_rad[number % shifts_rad.len()];
        let pattern = Pattern::Fringes { direction: Direction::Columns, pattern: self.rig.columns, shift_rad };
        let seed = ImageSeed { seed: self.options.seed, camera: camera as u8, image: number as u32 };
        let colours = self.colours(camera, ImageKind::Phase(number), &pattern, seed)?;
        let format = self.options.images.format();
        colours.into_iter().next().ok_or(SimulationError::Compressed { format })
    }

    /// Whether the sequence has Gray code.
    pub(crate) fn has_gray_code(&self) -> bool {
        self.options.gray
    }

    /// Returns the simulation with the object at rest, in its pose in the middle of its phase images; `None` if it does
    /// not move.
    pub(crate) fn at_rest(&self) -> Option<Self> {
        self.motion.as_ref()?;
        Some(Self { motion: None, staging: Staging { motion: None, ..self.staging }, ..self.clone() })
    }

    fn direction(
        &self,
        direction: Direction,
        phase: fn(usize) -> ImageKind,
        gray: fn(usize) -> ImageKind,
    ) -> Vec<(ImageKind, Pattern)> {
        let sequence = self.sequence(direction);
        let pattern = sequence.pattern;
        let fringes = sequence.shifts_rad.iter().enumerate();
        let fringes = fringes.map(|(k, &shift_rad)| (phase(k), Pattern::Fringes { direction, pattern, shift_rad }));
        let bits = sequence.gray.map_or(0, |g| g.images);
        let code = (0..bits)
            .map(|k| (gray(k), Pattern::Gray { direction, period_px: pattern.period_px, bit: (bits - 1 - k) as u32 }));
        fringes.chain(code).collect()
    }

    fn sequence(&self, direction: Direction) -> FringeSequence {
        let (pattern, cycles) = match direction {
            Direction::Columns => (self.rig.columns, self.staging.motion.map_or(1, |motion| motion.cycles)),
            Direction::Rows => (self.rig.rows, 1),
        };
        FringeSequence {
            pattern,
            shifts_rad: even_shifts_rad(self.options.steps).repeat(cycles),
            gray: self.options.gray.then(|| GrayCode { images: self.rig.gray_images(), cell_periods: 0.5 }),
        }
    }

    /// Takes all images and writes them to a dataset folder, without the truth. Calls `on_image` after each image of
    /// both cameras.
    ///
    /// A moving object moves only in the phase images of the first direction. All other images show it at rest, in the
    /// middle of its phase images, where the truth holds.
    pub(crate) fn write_images(
        &self,
        folder: &Path,
        mut on_image: impl FnMut(),
    ) -> Result<DatasetWriter, SimulationError> {
        let writer = DatasetWriter::create(folder, &self.description())?;
        writer.calibration(&self.rig.calibrated, Some(&self.rig.exact), UNIT)?;
        for (number, (kind, pattern)) in self.images().into_iter().enumerate() {
            let views = CameraId::BOTH.map(|camera| {
                let seed = ImageSeed { seed: self.options.seed, camera: camera as u8, image: number as u32 };
                self.colours(camera, kind, &pattern, seed)
            });
            let [first, second] = views;
            self.write_views(&writer, kind, &[first?, second?])?;
            on_image();
        }
        Ok(writer)
    }

    /// Writes an image of both cameras, in the format and arrangement of the options.
    fn write_views(
        &self,
        writer: &DatasetWriter,
        kind: ImageKind,
        views: &[Vec<GreyImage>; 2],
    ) -> Result<(), SimulationError> {
        match device::source_of_files(self.options.images) {
            Some(images) if images.holds_both_views() => writer.source_image(None, kind, &packed(images, views))?,
            source => {
                for (camera, colours) in CameraId::BOTH.into_iter().zip(views) {
                    match (source, &colours[..]) {
                        (None, [grey]) => writer.image(camera, kind, grey)?,
                        _ => {
                            let bytes = packed(self.options.images, std::slice::from_ref(colours));
                            writer.source_image(Some(camera), kind, &bytes)?;
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Images of a camera: one for each colour of a pixel.
    fn colours(
        &self,
        camera: CameraId,
        kind: ImageKind,
        pattern: &Pattern,
        seed: ImageSeed,
    ) -> Result<Vec<GreyImage>, SimulationError> {
        let options = &self.options;
        let noise = options.noise.noise().map(|noise| noise.binned(options.binning));
        let usual = Sensor::exposed(noise, options.gamma);
        let exposed = Sensor { gain: usual.gain * options.exposure / self.rig.light(&options.rig), ..usual };
        let sensors = device::filters(options.images.format()).into_iter().map(|filter| Sensor {
            format: device::sensor_format(options.images.format()),
            filter,
            ..exposed
        });
        let (Some(motion), ImageKind::Phase(number)) = (&self.motion, kind) else {
            return Ok(sensors.map(|sensor| sensor.image(&self.views[camera as usize], pattern, seed)).collect());
        };
        let seen = |view: View| if self.staging.covered == Some(camera) { view.half_covered() } else { view };
        let (middle, parts) = motion.views(&self.rig, &self.scene, camera, number, options.supersampling)?;
        let (middle, parts) = (seen(middle), parts.into_iter().map(seen).collect::<Vec<_>>());
        let image = |sensor: Sensor| {
            let sensitivity = sensor.sensitivity(options.rig.size_px, seed);
            sensor.exposure((&middle, &parts), pattern, &sensitivity, seed)
        };
        Ok(sensors.map(image).collect())
    }

    fn description(&self) -> DatasetDescription {
        let options = &self.options;
        DatasetDescription {
            name: options.object.name().to_owned(),
            unit: UNIT,
            readout: Readout::whole(options.rig.size_px),
            pixel_format: options.images.pixel_format(1),
            source: device::source_of_files(self.options.images),
            steps: options.steps,
            sequence: self.sequence(Direction::Columns),
            second_direction: options.two_directions.then(|| self.sequence(Direction::Rows)),
            volume: self.rig.volume,
            exact_cam1_from_volume: Some(*self.rig.exact_volume.cam1_from_volume()),
            motion: self.motion(),
            remarks: self.remarks(),
        }
    }

    fn remarks(&self) -> serde_json::Map<String, serde_json::Value> {
        let options = &self.options;
        let format = device::sensor_format(options.images.format());
        let mut remarks = remarks(&self.rig, options.noise, format, options.gamma, options.seed);
        remarks.extend(self.staging.remarks());
        if let Board::Apart(board) = options.board
            && options.board != Board::BEHIND
        {
            remarks.insert("board".to_owned(), json!(board));
        }
        if options.binning > 1 {
            remarks.insert("binning".to_owned(), json!(options.binning));
        }
        if let Some(at_mm) = options.rig.projector_at_mm {
            remarks.insert("projector_at_mm".to_owned(), json!(at_mm));
        }
        if options.exposure != 1.0 {
            remarks.insert("exposure".to_owned(), json!(options.exposure));
        }
        if options.rig.lens_error > 0.0 {
            remarks.insert("lens_error".to_owned(), json!(options.rig.lens_error));
        }
        remarks.insert("truth".to_owned(), json!("truth.npz in the frame of C1 (exact calibration)"));
        remarks
    }
}

/// Builds the scene of the options.
fn scene(options: &SimulationOptions, staging: &Staging, rig: &VirtualRig) -> Result<Scene, SimulationError> {
    options.board.check()?;
    let mut scene = Scene::from_shifted_object(options.object, staging.shift_mm, options.board, &rig.exact_volume);
    scene.check_board(&rig.exact)?;
    if let Some(percent) = staging.share_percent {
        scene = scene.scaled(options.object, image_share::factor(rig, options.object, staging.shift_mm, percent)?);
    }
    if staging.albedo.is_some() || staging.gloss > 0.0 {
        scene = scene.coated(staging.albedo, staging.gloss);
    }
    Ok(if staging.hand { scene.with_hand(&rig.exact_volume) } else { scene })
}

/// Returns remarks for a description about how its images were simulated.
pub(super) fn remarks(
    rig: &VirtualRig,
    level: NoiseLevel,
    format: PixelFormat,
    gamma: f64,
    seed: u64,
) -> serde_json::Map<String, serde_json::Value> {
    let noise = level.noise().map_or_else(
        || json!({ "level": level.name(), "adc_bits": format.bits() }),
        |noise| {
            json!({
                "level": level.name(),
                "full_well_e_at_255": noise.full_well_e,
                "read_noise_e": noise.read_noise_e,
                "prnu": noise.prnu,
                "adc_bits": format.bits(),
            })
        },
    );
    let fields =
        [("noise", noise), ("calib_error", json!(rig.deviation)), ("gamma", json!(gamma)), ("seed", json!(seed))];
    fields.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}
