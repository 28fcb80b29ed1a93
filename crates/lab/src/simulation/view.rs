//! The view of a camera without a pattern: the projector pixel that lights each point, and the brightness of the point.
//!
//! In: a rig, a scene, a camera. Out: a [`View`], from which the image of any pattern is computed without tracing. One
//! ray is traced per pixel. If a pixel and its neighbours do not belong to one smooth, evenly lit piece of surface, its
//! samples are traced too. Otherwise they are interpolated linearly.

use rayon::prelude::*;

use fringeflow::geometry::{Camera, Pixel, Point3, Pose, Rig, Vector3};
use fringeflow_dataset::CameraId;

use super::ray::Ray;
use super::scene::Scene;
use super::smooth_surface::{self, Seen};
use super::solid::{Material, PointMm};
use super::trace::{Hit, first_hit, is_free};
use super::{SimulationError, check_range};

/// Most samples along each side of a pixel.
pub(super) const MAX_SUPERSAMPLING: usize = 4;

/// A point on a surface as a camera sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Column of the projector pixel that lights the point, pixels; 0 in shadow.
    pub column_px: f32,
    /// Row of that projector pixel, pixels; 0 in shadow.
    pub row_px: f32,
    /// Reflected share of the light of the projector: albedo, cosine, gloss and distance; 0 in shadow.
    pub reflected: f32,
    /// Reflected share of the ambient light; 0 if there is no surface.
    pub albedo: f32,
}

/// The view of one camera, row by row, with `per_pixel` samples per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Samples per pixel.
    pub per_pixel: usize,
    /// `width · height · per_pixel` samples.
    pub samples: Vec<Sample>,
    /// What the centre of every pixel sees. A view for images alone has none.
    pub centres: Vec<Centre>,
}

/// What the centre of a pixel sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Centre {
    /// The point that its ray hits; `None` if there is no surface.
    pub hit: Option<Hit>,
    /// Light at that point.
    pub sample: Sample,
}

impl Centre {
    fn seen(&self) -> Seen {
        Seen { surface: self.hit.map(|hit| hit.surface), sample: self.sample }
    }
}

/// Largest deviations from linearity for interpolating samples: projector pixels, and share of the brightness.
const SMOOTH_PX: f32 = 0.08;
const SMOOTH_SHARE: f32 = 0.1;
/// Exponent of the lobe of Blinn: a highlight has half its brightness 9° off the mirror direction.
const GLOSS_EXPONENT: i32 = 60;
/// Distance from the projector at which `reflected` is albedo times cosine, metres.
const REFERENCE_DISTANCE_M: f64 = 0.31;

impl View {
    /// Traces the view of a camera of `rig`, with `supersampling`² samples per pixel.
    ///
    /// # Errors
    /// [`SimulationError::Range`]: there are more than 4 × 4 samples, or none.
    pub fn trace(rig: &Rig, scene: &Scene, camera: CameraId, supersampling: usize) -> Result<Self, SimulationError> {
        let eye = Eye::new(rig, scene, camera);
        let centres = eye.centres();
        let seen = centres.iter().map(Centre::seen).collect();
        Ok(Self { centres, ..Self::of(&eye, seen, supersampling)? })
    }

    /// As [`Self::trace`], but without centres, and with less work: see [`super::smooth_surface`].
    ///
    /// # Errors
    /// As [`Self::trace`].
    pub(super) fn for_images(
        rig: &Rig,
        scene: &Scene,
        camera: CameraId,
        supersampling: usize,
    ) -> Result<Self, SimulationError> {
        let eye = Eye::new(rig, scene, camera);
        let seen = smooth_surface::seen(&eye, eye.camera.width_px(), eye.camera.height_px());
        Self::of(&eye, seen, supersampling)
    }

    fn of(eye: &Eye<'_>, seen: Vec<Seen>, supersampling: usize) -> Result<Self, SimulationError> {
        check_range("supersampling", supersampling as f64, 1.0, MAX_SUPERSAMPLING as f64, "samples per side")?;
        let (width, height) = (eye.camera.width_px(), eye.camera.height_px());
        let grid = Grid { width, height, pixels: seen };
        let per_pixel = supersampling * supersampling;
        let mut samples = vec![Sample::default(); width * height * per_pixel];
        samples.par_chunks_mut((width * per_pixel).max(1)).enumerate().for_each(|(v, row)| {
            for (u, pixel) in row.chunks_exact_mut(per_pixel).enumerate() {
                grid.fill(eye, u, v, supersampling, pixel);
            }
        });
        Ok(Self { width, height, per_pixel, samples, centres: Vec::new() })
    }

    /// Samples of a pixel.
    pub(super) fn pixel(&self, index: usize) -> &[Sample] {
        &self.samples[index * self.per_pixel..][..self.per_pixel]
    }
}

/// A camera and the projector, in the frame of the object.
pub(super) struct Eye<'a> {
    rig: &'a Rig,
    pub(super) scene: &'a Scene,
    camera: &'a Camera,
    cam1_from_camera: Pose,
    /// Centre of the camera.
    centre: PointMm,
    /// Centre of the projector.
    pub(super) light: PointMm,
}

impl<'a> Eye<'a> {
    pub(super) fn new(rig: &'a Rig, scene: &'a Scene, camera: CameraId) -> Self {
        let (camera, cam1_from_camera) = match camera {
            CameraId::Cam1 => (&rig.cam1, Pose::identity()),
            CameraId::Cam2 => (&rig.cam2, rig.cam2_from_cam1.inverse()),
        };
        Self {
            rig,
            scene,
            camera,
            centre: scene.to_object(&(cam1_from_camera * Point3::origin())),
            light: scene.to_object(&rig.centre_of_projector()),
            cam1_from_camera,
        }
    }

    /// Returns the ray of an image point.
    pub(super) fn ray(&self, pixel: &Pixel) -> Option<Ray> {
        let direction: Vector3 = self.cam1_from_camera.rotation * self.camera.ray(pixel)?;
        Some(Ray { origin: self.centre, direction: self.scene.direction_to_object(&direction.normalize()) })
    }

    /// Returns the first hit of the ray of an image point.
    fn hit(&self, pixel: &Pixel) -> Option<Hit> {
        first_hit(self.scene, &self.ray(pixel)?)
    }

    /// Returns the projector pixel whose ray leads to a point, whether or not something is in between; `None` outside
    /// the display.
    pub(super) fn projector_pixel(&self, hit: &Hit) -> Option<Pixel> {
        let pixel = self.rig.project_projector(&self.scene.to_cam1(&hit.point))?;
        self.rig.projector.sees(&pixel).then_some(pixel)
    }

    fn centres(&self) -> Vec<Centre> {
        let (width, height) = (self.camera.width_px(), self.camera.height_px());
        let mut pixels = vec![Centre::default(); width * height];
        pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(v, row)| {
            for (u, pixel) in row.iter_mut().enumerate() {
                *pixel = self.centre(u, v);
            }
        });
        pixels
    }

    /// Returns what the centre of a pixel sees.
    pub(super) fn seen(&self, u: usize, v: usize) -> Seen {
        self.centre(u, v).seen()
    }

    fn centre(&self, u: usize, v: usize) -> Centre {
        let hit = self.hit(&Pixel::new(u as f64, v as f64));
        hit.map_or_else(Centre::default, |hit| Centre { hit: Some(hit), sample: self.sample(&hit) })
    }

    fn sample(&self, hit: &Hit) -> Sample {
        match self.projector_pixel(hit) {
            Some(pixel) if is_free(self.scene, hit, &self.light) => self.sample_at(hit, &pixel),
            _ => self.dark_sample(hit),
        }
    }

    /// Returns the sample of a point that the projector does not light.
    pub(super) fn dark_sample(&self, hit: &Hit) -> Sample {
        let material = self.scene.material(hit.surface, &hit.point);
        Sample { albedo: self.scene.albedo(hit.surface, material, &hit.point) as f32, ..Sample::default() }
    }

    /// Returns the sample of a point that a pixel of the projector lights.
    pub(super) fn sample_at(&self, hit: &Hit, pixel: &Pixel) -> Sample {
        let material = self.scene.material(hit.surface, &hit.point);
        let albedo = self.scene.albedo(hit.surface, material, &hit.point);
        let to_light = self.light - hit.point;
        let distance_m = to_light.norm() * 1e-3;
        let cosine = to_light.dot(&hit.normal).max(0.0) / to_light.norm();
        let reflected = (albedo * cosine + self.highlight(hit, material)) * (REFERENCE_DISTANCE_M / distance_m).powi(2);
        Sample { column_px: pixel.x as f32, row_px: pixel.y as f32, reflected: reflected as f32, albedo: albedo as f32 }
    }

    /// Returns the light that a glossy point mirrors towards the camera (Blinn 1977).
    fn highlight(&self, hit: &Hit, material: Material) -> f64 {
        if material.gloss == 0.0 {
            return 0.0;
        }
        let [to_light, to_camera] = [self.light, self.centre].map(|target| (target - hit.point).normalize());
        let between = (to_light + to_camera).normalize();
        material.gloss * between.dot(&hit.normal).max(0.0).powi(GLOSS_EXPONENT)
    }
}

/// What the centres of all pixels see.
struct Grid {
    width: usize,
    height: usize,
    pixels: Vec<Seen>,
}

impl Grid {
    /// Fills the samples of a pixel. They are interpolated on a smooth piece of surface, and traced elsewhere.
    fn fill(&self, eye: &Eye<'_>, u: usize, v: usize, side: usize, samples: &mut [Sample]) {
        if let [sample] = samples {
            *sample = self.pixels[v * self.width + u].sample;
            return;
        }
        let slopes = self.slopes(u, v);
        for (i, sample) in samples.iter_mut().enumerate() {
            let offset = |k: usize| (k as f64 + 0.5) / side as f64 - 0.5;
            let (du, dv) = (offset(i % side), offset(i / side));
            *sample = match &slopes {
                Some(slopes) => slopes.sample(du as f32, dv as f32),
                None => {
                    let hit = eye.hit(&Pixel::new(u as f64 + du, v as f64 + dv));
                    hit.map_or_else(Sample::default, |hit| eye.sample(&hit))
                }
            };
        }
    }

    /// Returns the slopes at a pixel, if it and its neighbours are linear.
    fn slopes(&self, u: usize, v: usize) -> Option<Slopes> {
        if u == 0 || v == 0 || u + 1 >= self.width || v + 1 >= self.height {
            return None;
        }
        let at = |du: usize, dv: usize| {
            let Seen { surface, sample } = self.pixels[(v + dv - 1) * self.width + u + du - 1];
            (surface, sample)
        };
        let (surface, middle) = at(1, 1);
        // Opposite neighbours along rows, columns and both diagonals.
        for (a, b) in [((0, 1), (2, 1)), ((1, 0), (1, 2)), ((0, 0), (2, 2)), ((2, 0), (0, 2))] {
            let ((surface_a, a), (surface_b, b)) = (at(a.0, a.1), at(b.0, b.1));
            if surface_a != surface || surface_b != surface || !on_one_line(&a, &middle, &b) {
                return None;
            }
        }
        Some(Slopes {
            middle,
            along_u: half_difference(&at(0, 1).1, &at(2, 1).1),
            along_v: half_difference(&at(1, 0).1, &at(1, 2).1),
        })
    }
}

/// Linear change of a sample around the centre of its pixel.
struct Slopes {
    middle: Sample,
    along_u: Sample,
    along_v: Sample,
}

impl Slopes {
    fn sample(&self, du: f32, dv: f32) -> Sample {
        let (m, a, b) = (&self.middle, &self.along_u, &self.along_v);
        Sample {
            column_px: m.column_px + a.column_px * du + b.column_px * dv,
            row_px: m.row_px + a.row_px * du + b.row_px * dv,
            reflected: m.reflected + a.reflected * du + b.reflected * dv,
            albedo: m.albedo + a.albedo * du + b.albedo * dv,
        }
    }
}

fn on_one_line(a: &Sample, middle: &Sample, b: &Sample) -> bool {
    let lit = [a, middle, b].map(|s| s.reflected > 0.0);
    let bend = |f: fn(&Sample) -> f32| (f(a) + f(b) - 2.0 * f(middle)).abs();
    lit[0] == lit[1]
        && lit[1] == lit[2]
        && bend(|s| s.column_px) <= SMOOTH_PX
        && bend(|s| s.row_px) <= SMOOTH_PX
        && bend(|s| s.reflected) <= SMOOTH_SHARE * middle.reflected
}

fn half_difference(a: &Sample, b: &Sample) -> Sample {
    Sample {
        column_px: (b.column_px - a.column_px) / 2.0,
        row_px: (b.row_px - a.row_px) / 2.0,
        reflected: (b.reflected - a.reflected) / 2.0,
        albedo: (b.albedo - a.albedo) / 2.0,
    }
}
