//! Smooth fields over an image, as bicubic polynomials on patches of 16 × 16 pixels.
//!
//! In: exact values at nodes. Each patch has 4 × 4 nodes and shares those of its border. Out: a quarter of a byte per
//! pixel and field. Evaluation takes a handful of multiplications and works on sixteen columns of a row at once.
//! Multiplications and additions are never fused, so that every machine computes the same bits.

use rayon::prelude::*;

/// Side of a patch, pixels.
pub(super) const PATCH_PX: usize = 16;
/// Nodes along a side of a patch, without the last one, which belongs to the next patch.
const STEPS: usize = 3;
/// Coefficients of a cubic polynomial.
pub(super) const POWERS: usize = 4;
/// Half a side. Places in a patch are counted from its centre, which keeps rounding small.
const HALF_PX: f64 = PATCH_PX as f64 / 2.0;
/// The columns of a patch, counted from its centre. A patch reaches half a pixel beyond the outer pixel centres.
const COLUMNS: [f32; PATCH_PX] = {
    let mut columns = [0.0; PATCH_PX];
    let mut i = 0;
    while i < PATCH_PX {
        columns[i] = i as f32 + 0.5 - HALF_PX as f32;
        i += 1;
    }
    columns
};

/// The nodes of an image, row by row. Nodes at the border lie slightly outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nodes {
    /// Patches along either axis.
    patches: [usize; 2],
}

impl Nodes {
    /// The nodes of an image of a size in pixels.
    pub(super) fn from_size_px(size_px: [usize; 2]) -> Self {
        Self { patches: size_px.map(|side| side.div_ceil(PATCH_PX)) }
    }

    /// Computes a value for each node from its place in pixels, in parallel.
    pub(super) fn map<T: Send>(&self, value: impl Fn(f64, f64) -> T + Sync) -> Vec<T> {
        let [columns, rows] = self.patches.map(|patches| STEPS * patches + 1);
        let place_px = |node: usize| node as f64 * (PATCH_PX as f64 / STEPS as f64) - 0.5;
        let value = &value;
        (0..rows)
            .into_par_iter()
            .flat_map_iter(|row| (0..columns).map(move |column| value(place_px(column), place_px(row))))
            .collect()
    }
}

/// Fields over an image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Patches<const FIELDS: usize> {
    /// Patches along either axis.
    patches: [usize; 2],
    /// Row of patches by row of patches: for each power of the row, then patch by patch and field by field, the
    /// coefficients of the powers of the column.
    coefficients: Vec<[f32; POWERS]>,
}

impl<const FIELDS: usize> Patches<FIELDS> {
    /// The fields through the values at `nodes`. A patch with a node without a value is `undefined` everywhere.
    pub(super) fn through(nodes: Nodes, values: &[Option<[f64; FIELDS]>], undefined: [f32; FIELDS]) -> Self {
        let patches @ [columns, _] = nodes.patches;
        let mut coefficients = vec![[0.0; POWERS]; Self::groups(patches)];
        let width = STEPS * columns + 1;
        coefficients.par_chunks_mut(POWERS * columns * FIELDS).enumerate().for_each(|(row, out)| {
            for column in 0..columns {
                let node = |i: usize, j: usize| values[(STEPS * row + i) * width + STEPS * column + j];
                let of_patch = patch(node).unwrap_or_else(|| constant(undefined));
                for (power, of_power) in of_patch.iter().enumerate() {
                    out[(power * columns + column) * FIELDS..][..FIELDS].copy_from_slice(of_power);
                }
            }
        });
        Self { patches, coefficients }
    }

    /// Fields that are zero everywhere, to be overwritten.
    pub(super) fn zeroed(size_px: [usize; 2]) -> Self {
        let Nodes { patches } = Nodes::from_size_px(size_px);
        Self { patches, coefficients: vec![[0.0; POWERS]; Self::groups(patches)] }
    }

    /// All coefficients, for a file.
    pub(super) fn coefficients(&self) -> &[[f32; POWERS]] {
        &self.coefficients
    }

    /// The coefficients, to be read from a file.
    pub(super) fn coefficients_mut(&mut self) -> &mut [[f32; POWERS]] {
        &mut self.coefficients
    }

    /// Number of coefficients of the fields over an image.
    pub(super) fn numbers(size_px: [usize; 2]) -> usize {
        POWERS * Self::groups(Nodes::from_size_px(size_px).patches)
    }

    /// Number of groups of coefficients for these patches.
    fn groups([columns, rows]: [usize; 2]) -> usize {
        POWERS * columns * rows * FIELDS
    }

    /// The fields along a row of pixels.
    #[inline(always)]
    pub(super) fn row(&self, v: usize) -> FieldRow<'_, FIELDS> {
        let columns = self.patches[0];
        let (groups, _) = self.coefficients.as_chunks::<FIELDS>();
        let of_row = &groups[POWERS * columns * (v / PATCH_PX)..][..POWERS * columns];
        let power = |i: usize| &of_row[i * columns..][..columns];
        FieldRow { powers: [power(0), power(1), power(2), power(3)], t: COLUMNS[v % PATCH_PX] }
    }
}

/// Fields along a row of pixels.
#[derive(Clone, Copy)]
pub(super) struct FieldRow<'a, const FIELDS: usize> {
    /// Coefficients of each power of the row, patch by patch.
    powers: [&'a [[[f32; POWERS]; FIELDS]]; POWERS],
    /// The row, from the centre of its patches.
    t: f32,
}

impl<'a, const FIELDS: usize> FieldRow<'a, FIELDS> {
    /// One field at a column.
    #[inline]
    pub(super) fn at(&self, field: usize, u: usize) -> f32 {
        let patch = u / PATCH_PX;
        let [p0, p1, p2, p3] = self.powers.map(|power| &power[patch][field]);
        let along_row = std::array::from_fn(|i| cubic([p0[i], p1[i], p2[i], p3[i]], self.t));
        cubic(along_row, COLUMNS[u % PATCH_PX])
    }

    /// One field at the columns of a patch.
    #[inline(always)]
    pub(super) fn patch(&self, field: usize, patch: usize, columns: &Columns) -> [f32; PATCH_PX] {
        let [p0, p1, p2, p3] = self.powers;
        let (p0, p1, p2, p3) = (&p0[patch][field], &p1[patch][field], &p2[patch][field], &p3[patch][field]);
        let mut along_row = [0.0; POWERS];
        for i in 0..POWERS {
            along_row[i] = cubic([p0[i], p1[i], p2[i], p3[i]], self.t);
        }
        columns.values(&along_row)
    }

    /// Writes the coefficients of the powers of the column to `out`, patch by patch and field by field.
    #[inline(always)]
    pub(super) fn along_row(&self, out: &mut [[[f32; POWERS]; FIELDS]]) {
        let [p0, p1, p2, p3] = self.powers.map(|power| power.as_flattened().as_flattened());
        let out = out.as_flattened_mut().as_flattened_mut();
        for ((((out, &c0), &c1), &c2), &c3) in out.iter_mut().zip(p0).zip(p1).zip(p2).zip(p3) {
            *out = cubic([c0, c1, c2, c3], self.t);
        }
    }
}

/// The sixteen columns of a patch.
#[derive(Clone, Copy)]
pub(super) struct Columns([f32; PATCH_PX]);

impl Columns {
    /// Hides the numbers from the compiler, which would split them into pairs that differ in sign alone.
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self(std::hint::black_box(COLUMNS))
    }

    /// A cubic polynomial at the columns.
    #[inline(always)]
    pub(super) fn values(&self, coefficients: &[f32; POWERS]) -> [f32; PATCH_PX] {
        // Each patch by itself: with several at once the compiler would spread the numbers over memory.
        let coefficients = *std::hint::black_box(coefficients);
        let mut values = [0.0; PATCH_PX];
        for i in 0..PATCH_PX {
            values[i] = cubic(coefficients, self.0[i]);
        }
        values
    }
}

#[inline(always)]
fn cubic([c0, c1, c2, c3]: [f32; POWERS], t: f32) -> f32 {
    c0 + t * (c1 + t * (c2 + t * c3))
}

/// Coefficients of a patch through its nodes: power of the row, field, power of the column.
fn patch<const FIELDS: usize>(
    node: impl Fn(usize, usize) -> Option<[f64; FIELDS]>,
) -> Option<[[[f32; POWERS]; FIELDS]; POWERS]> {
    let mut values = [[[0.0; FIELDS]; POWERS]; POWERS];
    for (i, row) in values.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            *value = node(i, j)?;
        }
    }
    let mut coefficients = [[[0.0; POWERS]; FIELDS]; POWERS];
    for field in 0..FIELDS {
        let along_rows = values.map(|row| through_nodes(row.map(|value| value[field])));
        for j in 0..POWERS {
            let along_column = through_nodes(along_rows.map(|row| row[j]));
            for i in 0..POWERS {
                coefficients[i][field][j] = along_column[i] as f32;
            }
        }
    }
    let finite = coefficients.iter().flatten().flatten().all(|c| c.is_finite());
    finite.then_some(coefficients)
}

/// The coefficients of a patch on which every field is constant.
fn constant<const FIELDS: usize>(values: [f32; FIELDS]) -> [[[f32; POWERS]; FIELDS]; POWERS] {
    let mut coefficients = [[[0.0; POWERS]; FIELDS]; POWERS];
    coefficients[0] = values.map(|value| [value, 0.0, 0.0, 0.0]);
    coefficients
}

/// The cubic polynomial through values at the nodes of a side: −8, −8/3, 8/3 and 8.
fn through_nodes([y0, y1, y2, y3]: [f64; POWERS]) -> [f64; POWERS] {
    let c = [
        -y0 + 9.0 * y1 + 9.0 * y2 - y3,
        y0 - 27.0 * y1 + 27.0 * y2 - y3,
        9.0 * (y0 - y1 - y2 + y3),
        9.0 * (-y0 + 3.0 * y1 - 3.0 * y2 + y3),
    ];
    let mut scale = 1.0 / 16.0;
    c.map(|c| {
        let scaled = c * scale;
        scale /= HALF_PX;
        scaled
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(u: f64, v: f64) -> f64 {
        3.0 + 0.5 * u - 0.25 * v + 1e-3 * u * v - 2e-4 * u * u * v + 1e-5 * u.powi(3) - 3e-5 * v.powi(3)
    }

    fn patches(undefined_from_px: f64) -> Patches<2> {
        let nodes = Nodes::from_size_px([40, 23]);
        let values = nodes.map(|u, v| (u < undefined_from_px).then(|| [exact(u, v), -exact(u, v)]));
        Patches::through(nodes, &values, [-1.0, -2.0])
    }

    #[test]
    fn cubic_fields_are_met_at_every_pixel() {
        let patches = patches(f64::INFINITY);
        for v in 0..23 {
            let row = patches.row(v);
            for u in 0..40 {
                let wanted = exact(u as f64, v as f64);
                assert!((f64::from(row.at(0, u)) - wanted).abs() < 1e-4, "{u} {v}");
                assert!((f64::from(row.at(1, u)) + wanted).abs() < 1e-4, "{u} {v}");
            }
        }
    }

    #[test]
    fn a_pixel_has_the_bits_of_its_patch() {
        let patches = patches(f64::INFINITY);
        let row = patches.row(19);
        let mut along_row = [[[0.0; POWERS]; 2]; 3];
        row.along_row(&mut along_row);
        for u in 0..40 {
            assert_eq!(
                row.at(1, u).to_bits(),
                Columns::new().values(&along_row[u / PATCH_PX][1])[u % PATCH_PX].to_bits()
            );
        }
    }

    #[test]
    fn a_patch_with_an_undefined_node_is_undefined_all_over() {
        let patches = patches(30.0);
        let row = patches.row(5);
        assert!((f64::from(row.at(0, 15)) - exact(15.0, 5.0)).abs() < 1e-4);
        assert_eq!([16, 31].map(|u| [row.at(0, u), row.at(1, u)]), [[-1.0, -2.0]; 2]);
    }
}
