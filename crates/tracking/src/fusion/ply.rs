//! Writes a model as PLY, binary little-endian, with one vertex per surfel.

use std::io::{self, Write};
use std::path::Path;

use fringeflow::cloud::{CloudExport, Scalar, ply_header};
use fringeflow_base::atomic_file::{WriteError, write_atomically};

use super::model::Model;
use super::surfel::Surfel;

/// Name and type of each property, in the order of the file. `sigma` has the unit of `x y z`; the colour is the grey level.
const FIELDS: [(&str, Scalar); 12] = [
    ("x", Scalar::F32),
    ("y", Scalar::F32),
    ("z", Scalar::F32),
    ("nx", Scalar::F32),
    ("ny", Scalar::F32),
    ("nz", Scalar::F32),
    ("intensity", Scalar::U8),
    ("sigma", Scalar::F32),
    ("support", Scalar::U16),
    ("red", Scalar::U8),
    ("green", Scalar::U8),
    ("blue", Scalar::U8),
];

/// Writes the surfels with enough support, and returns their number.
///
/// # Errors
/// The file cannot be written. An existing file then stays unchanged.
pub fn write_model(
    path: &Path,
    model: &Model,
    min_support: u32,
    export: &CloudExport<'_>,
) -> Result<usize, WriteError> {
    let count = model.supported(min_support).count();
    let mut remarks = export.remarks().to_vec();
    remarks.push(("origin", format!("cam1 at the first of {} clouds", model.clouds())));
    write_atomically(path, |out| {
        out.write_all(ply_header(count, &remarks, &FIELDS).as_bytes())?;
        model.supported(min_support).try_for_each(|surfel| write(out, surfel, f64::from(export.units_per_metre())))
    })?;
    Ok(count)
}

fn write(out: &mut impl Write, surfel: &Surfel, per_metre: f64) -> io::Result<()> {
    let position = surfel.position().coords * per_metre;
    for value in position.iter().chain(surfel.normal().iter()) {
        out.write_all(&(*value as f32).to_le_bytes())?;
    }
    let grey = surfel.intensity.round() as u8;
    out.write_all(&[grey])?;
    out.write_all(&((surfel.sigma_m() * per_metre) as f32).to_le_bytes())?;
    out.write_all(&u16::try_from(surfel.support).unwrap_or(u16::MAX).to_le_bytes())?;
    out.write_all(&[grey; 3])
}
