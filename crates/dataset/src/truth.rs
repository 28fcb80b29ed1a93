//! `truth.npz`: ground truth of a dataset.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Cursor, Read, Seek, Write};
use std::path::Path;

use fringeflow_base::npz::{NpzReader, NpzWriter};
use npyz::{Deserialize, Order};

use super::Problem;

/// Ground truth of a dataset.
#[derive(Clone, Debug)]
pub enum Truth {
    /// Ground truth of a rendered dataset, known for every pixel of C1.
    Rendered(RenderedTruth),
    /// Ground truth of a captured dataset, found by a Gray-code reference method.
    Captured(CapturedTruth),
}

/// Exact ground truth of a rendered dataset, per pixel of C1, row by row.
#[derive(Clone, Debug)]
pub struct RenderedTruth {
    /// Raw sub-pixel point in C2, pixels; NaN if the ray hit nothing.
    pub cam2_px: Vec<[f32; 2]>,
    /// Point in the frame of the exact C1, in the unit of the dataset; valid if `measurable`.
    pub point: Vec<[f32; 3]>,
    /// Whether the point is visible in C2.
    pub seen_by_cam2: Vec<bool>,
    /// Whether the point is lit by the projector.
    pub lit: Vec<bool>,
    /// Whether the point lies in the measurement volume.
    pub in_volume: Vec<bool>,
    /// Whether the ray hits a point that is visible in C2, lit, and in the volume.
    pub measurable: Vec<bool>,
    /// Whether the pixel belongs to the reference data RD of the paper: `measurable` and, with Gray code, found by the
    /// Gray-code reference method.
    pub reference: Vec<bool>,
    /// Point in C2 found with Gray code outside `reference`; NaN elsewhere. `None` without Gray code and for moving
    /// objects.
    pub gray_cam2_px: Option<Vec<[f32; 2]>>,
}

/// Gray-code reference of a captured dataset, one entry per point.
#[derive(Clone, Debug)]
pub struct CapturedTruth {
    /// Sub-pixel point in C1, pixels.
    pub cam1_px: Vec<[f32; 2]>,
    /// Corresponding point in C2, pixels.
    pub cam2_px: Vec<[f32; 2]>,
    /// 3D point, frame of C1, millimetres.
    pub point_mm: Vec<[f32; 3]>,
    /// Back-projection residual of the reference method, rad.
    pub residual_rad: Vec<f32>,
}

/// Reads a truth file for images of `size_px`.
pub(super) fn read(path: &Path, size_px: [usize; 2]) -> Result<Truth, Problem> {
    let file = File::open(path).map_err(Problem::Unreadable)?;
    parse(BufReader::new(file), size_px)
}

impl Truth {
    /// Reads the content of a truth file for images of `size_px`.
    ///
    /// # Errors
    /// An array has an unexpected name, shape or type.
    pub fn parse(bytes: &[u8], size_px: [usize; 2]) -> Result<Self, Problem> {
        parse(Cursor::new(bytes), size_px)
    }
}

fn parse(file: impl Read + Seek, size_px: [usize; 2]) -> Result<Truth, Problem> {
    let archive = NpzReader::new(file).map_err(|e| Problem::Truth(e.to_string()))?;
    let mut arrays = Arrays { archive, shape: [size_px[1] as u64, size_px[0] as u64] };
    if arrays.has("gt") { arrays.rendered().map(Truth::Rendered) } else { arrays.captured().map(Truth::Captured) }
}

/// Writes the ground truth of a rendered dataset as NumPy arrays. `valid` marks the pixels whose ray hit something.
pub(super) fn write(path: &Path, truth: &RenderedTruth, size_px: [usize; 2]) -> Result<(), Problem> {
    let mut out = File::create(path).map(BufWriter::new).map_err(Problem::Unwritable)?;
    write_arrays(&mut out, truth, size_px).and_then(|()| out.flush()).map_err(Problem::Unwritable)
}

fn write_arrays(out: &mut BufWriter<File>, truth: &RenderedTruth, size_px: [usize; 2]) -> io::Result<()> {
    let [cols, rows] = size_px.map(|n| n as u64);
    let mut npz = NpzWriter::new(out);
    let valid: Vec<bool> = truth.cam2_px.iter().map(|q| q[0].is_finite()).collect();
    npz.array("XYZ", &[rows, cols, 3], truth.point.as_flattened().iter().copied())?;
    npz.array("x2", &[rows, cols, 2], truth.cam2_px.as_flattened().iter().copied())?;
    let masks = [
        ("valid", &valid),
        ("vis2", &truth.seen_by_cam2),
        ("lit", &truth.lit),
        ("involume", &truth.in_volume),
        ("gt", &truth.measurable),
        ("rd", &truth.reference),
    ];
    for (name, mask) in masks {
        npz.array(name, &[rows, cols], mask.iter().copied())?;
    }
    if let Some(gray) = &truth.gray_cam2_px {
        npz.array("egc_x2", &[rows, cols, 2], gray.as_flattened().iter().copied())?;
    }
    npz.finish()?;
    Ok(())
}

struct Arrays<R: Read + Seek> {
    archive: NpzReader<R>,
    /// Rows, columns of the images.
    shape: [u64; 2],
}

impl<R: Read + Seek> Arrays<R> {
    fn has(&self, name: &str) -> bool {
        self.archive.names().any(|n| n == name)
    }

    fn rendered(&mut self) -> Result<RenderedTruth, Problem> {
        let [rows, cols] = self.shape;
        Ok(RenderedTruth {
            cam2_px: self.read::<f32, 2>("x2", &[rows, cols, 2])?,
            point: self.read::<f32, 3>("XYZ", &[rows, cols, 3])?,
            seen_by_cam2: self.mask("vis2")?,
            lit: self.mask("lit")?,
            in_volume: self.mask("involume")?,
            measurable: self.mask("gt")?,
            reference: self.mask("rd")?,
            gray_cam2_px: if self.has("egc_x2") {
                Some(self.read::<f32, 2>("egc_x2", &[rows, cols, 2])?)
            } else {
                None
            },
        })
    }

    fn captured(&mut self) -> Result<CapturedTruth, Problem> {
        let residual_rad: Vec<f32> = self.flat("backproj_resid_rad", None)?;
        let count = residual_rad.len() as u64;
        Ok(CapturedTruth {
            cam1_px: self.read::<f32, 2>("left_px", &[count, 2])?,
            cam2_px: self.read::<f32, 2>("right_px", &[count, 2])?,
            point_mm: self.read::<f32, 3>("xyz_left_cam_mm", &[count, 3])?,
            residual_rad,
        })
    }

    fn mask(&mut self, name: &str) -> Result<Vec<bool>, Problem> {
        let shape = self.shape;
        self.flat(name, Some(&shape))
    }

    fn read<T: Deserialize + Copy, const N: usize>(
        &mut self,
        name: &str,
        shape: &[u64],
    ) -> Result<Vec<[T; N]>, Problem> {
        let flat: Vec<T> = self.flat(name, Some(shape))?;
        Ok(flat.as_chunks::<N>().0.to_vec())
    }

    fn flat<T: Deserialize>(&mut self, name: &str, shape: Option<&[u64]>) -> Result<Vec<T>, Problem> {
        let broken = |e: io::Error| Problem::Truth(format!("array {name}: {e}"));
        let array = self.archive.array(name).map_err(broken)?;
        let array = array.ok_or_else(|| Problem::Truth(format!("array {name} is missing")))?;
        if let Some(shape) = shape
            && array.shape() != shape
        {
            return Err(Problem::Truth(format!("array {name} has shape {:?}; expected {shape:?}", array.shape())));
        }
        if array.order() != Order::C {
            return Err(Problem::Truth(format!("array {name} is stored in Fortran order; expected C order")));
        }
        array.into_vec().map_err(broken)
    }
}
