//! The rows of C2 that 32 pixels look into, and where they cross the phases of the pixels.

use fringeflow_simd::{COLUMNS, Lanes};

use crate::correspondence::epipolar_image::{EpipolarImage, MAX_NEIGHBOUR_STEP};

/// Largest phase difference between neighbouring columns at which a crossing counts, turns · 65536. Fringes on a
/// grazing surface are short, and at a silhouette two surfaces mix in one pixel. Near half a turn the sense of the step
/// is lost.
pub(in crate::correspondence) const MAX_COLUMN_STEP: i32 = 30000;

/// Most pairs of rows that a block may look into.
const MAX_PAIRS: usize = 4;

/// The rows of C2 that the pixels of a block look into, as pairs of neighbouring rows.
pub(in crate::correspondence) struct Rows<L: Lanes> {
    pairs: [RowPair<L>; MAX_PAIRS],
    count: usize,
    /// Share of the lower row, 1/65536.
    below: L::Words,
}

/// Two overlapping pairs of neighbouring rows: the first and the second row, and the second and the third.
#[derive(Clone, Copy)]
pub(in crate::correspondence) struct RowPair<L: Lanes> {
    /// Pixels that look into either pair.
    pub(in crate::correspondence) pixels: L::Mask,
    /// Where the rows begin.
    begins: [usize; 3],
    /// Pixels that look into the second pair.
    second: L::Mask,
    /// Whether any pixel does.
    straddles: bool,
}

impl<L: Lanes> Rows<L> {
    /// Finds the rows of `pixels` whose segments lie in rows `row`. Also returns the pixels whose rows were found: at
    /// most [`MAX_PAIRS`] are kept.
    #[inline(always)]
    pub(in crate::correspondence) fn new(
        lanes: L,
        image: &EpipolarImage,
        row: L::Floats,
        pixels: L::Mask,
    ) -> (Self, L::Mask) {
        let width = image.width;
        let last = image.phase.len() / width - 1;
        let (zero, none) = (lanes.float(0.0), lanes.mask(0));
        let upper = lanes.longs(lanes.min_float(lanes.max_float(row, zero), lanes.float(last as f32)));
        let share = lanes.times_float(lanes.sub_float(row, lanes.floats(upper)), lanes.float(65536.0));
        let below = lanes.narrow(lanes.longs(lanes.min_float(lanes.max_float(share, zero), lanes.float(65535.0))));
        let upper = lanes.narrow(upper);
        let pair = RowPair { pixels: none, begins: [0; 3], second: none, straddles: false };
        let mut rows = Self { pairs: [pair; MAX_PAIRS], count: 0, below };
        // Rows and columns are counted in signed 16-bit words.
        let is_small = last < i16::MAX as usize && width <= i16::MAX as usize;
        let mut todo = if is_small { pixels } else { none };
        let mut found = none;
        while lanes.any(todo) && rows.count < MAX_PAIRS {
            let first = lanes.least_of(todo, upper);
            let of_first = lanes.and(todo, lanes.is_equal(upper, lanes.word(first)));
            let second = lanes.and(todo, lanes.is_equal(upper, lanes.word(first + 1)));
            let pixels = lanes.or(of_first, second);
            let row = first as usize;
            let begins = [row * width, (row + 1).min(last) * width, (row + 2).min(last) * width];
            rows.pairs[rows.count] = RowPair { pixels, begins, second, straddles: lanes.any(second) };
            rows.count += 1;
            found = lanes.or(found, pixels);
            todo = lanes.and_not(todo, pixels);
        }
        (rows, found)
    }

    /// The pairs that were found.
    #[inline(always)]
    pub(in crate::correspondence) fn pairs(&self) -> &[RowPair<L>] {
        &self.pairs[..self.count]
    }
}

/// Lookup tables of 64 columns of three rows.
pub(in crate::correspondence) struct Tables<'a, L: Lanes> {
    lanes: L,
    rows: [L::Table<'a>; 3],
    pair: RowPair<L>,
    below: L::Words,
    phases: L::Words,
}

/// Scratch for columns at the end of the image.
pub(in crate::correspondence) type Ends = [[u16; COLUMNS]; 3];

impl<'a, L: Lanes> Tables<'a, L> {
    /// The columns from `base` on, for pixels with these phases.
    #[inline(always)]
    pub(in crate::correspondence) fn new(
        lanes: L,
        image: &'a EpipolarImage,
        rows: &Rows<L>,
        pair: RowPair<L>,
        base: i16,
        phases: L::Words,
        ends: &'a mut Ends,
    ) -> Self {
        let [a, b, c] = ends;
        let ([first, second, third], base) = (pair.begins, base as usize);
        let rows_of = [
            lanes.table(columns(image, first + base, a)),
            lanes.table(columns(image, second + base, b)),
            lanes.table(columns(image, third + base, c)),
        ];
        Self { lanes, rows: rows_of, pair, below: rows.below, phases }
    }

    /// The phase at places of the tables less that of the pixels; computed as by
    /// [`crate::correspondence::row_view::RowView`].
    #[inline(always)]
    pub(in crate::correspondence) fn difference(&self, place: L::Words) -> Differences<L> {
        let lanes = self.lanes;
        let [first, second, third] = self.rows;
        let (mut upper, mut lower) = (lanes.look_up(first, place), lanes.look_up(second, place));
        if self.pair.straddles {
            upper = lanes.select(self.pair.second, lower, upper);
            lower = lanes.select(self.pair.second, lanes.look_up(third, place), lower);
        }
        let (phase, known) = interpolate_rows(lanes, upper, lower, self.below);
        Differences { value: lanes.sub(phase, self.phases), known }
    }
}

/// Interpolates the phase between two rows, `below` being the share of the lower row in 1/65536, as
/// [`crate::correspondence::row_view::RowView`] does. Also returns where there is a phase.
#[inline(always)]
pub(in crate::correspondence) fn interpolate_rows<L: Lanes>(
    lanes: L,
    upper: L::Words,
    lower: L::Words,
    below: L::Words,
) -> (L::Words, L::Mask) {
    let (none, zero) = (lanes.word(EpipolarImage::NO_PHASE as i16), lanes.word(0));
    let (no_upper, no_lower) = (lanes.is_equal(upper, none), lanes.is_equal(lower, none));
    let step = lanes.sub(lower, upper);
    // Rows of different surfaces are not interpolated: the nearer row counts.
    let small = lanes.is_at_least(lanes.word(MAX_NEIGHBOUR_STEP as i16), lanes.abs(step));
    let interpolates = lanes.and_not(small, lanes.or(no_upper, no_lower));
    // The high word of a signed by an unsigned number, and the rounding.
    let sign = lanes.select(lanes.is_greater(zero, step), below, zero);
    let part = lanes.sub(lanes.times_high(step, below), sign);
    let part = lanes.add(part, lanes.shift_right::<15>(lanes.times_low(step, below)));
    let is_lower_nearer = lanes.is_greater(zero, below);
    let nearest = lanes.select(is_lower_nearer, lower, upper);
    let phase = lanes.select(interpolates, lanes.add(upper, part), nearest);
    (phase, lanes.or(interpolates, lanes.and_not(lanes.mask(u32::MAX), lanes.is_equal(nearest, none))))
}

/// 64 columns of the image from a place on. Columns beyond the end of the image have no phase.
#[inline(always)]
fn columns<'a>(image: &'a EpipolarImage, begin: usize, end: &'a mut [u16; COLUMNS]) -> &'a [u16; COLUMNS] {
    let rest = image.phase.get(begin..).unwrap_or_default();
    match rest.first_chunk() {
        Some(columns) => columns,
        None => {
            end.fill(EpipolarImage::NO_PHASE);
            end[..rest.len()].copy_from_slice(rest);
            end
        }
    }
}

/// Phases of C2 minus those of the pixels.
#[derive(Clone, Copy)]
pub(in crate::correspondence) struct Differences<L: Lanes> {
    pub(in crate::correspondence) value: L::Words,
    /// Pixels where C2 has a phase.
    pub(in crate::correspondence) known: L::Mask,
}

/// The pixels whose phase lies between two neighbouring columns.
#[inline(always)]
pub(in crate::correspondence) fn crosses<L: Lanes>(lanes: L, before: Differences<L>, after: Differences<L>) -> L::Mask {
    let zero = lanes.word(0);
    let (was_above, rises) = (lanes.is_greater(before.value, zero), lanes.is_greater(after.value, zero));
    let step = lanes.sub(after.value, before.value);
    let step = lanes.select(rises, step, lanes.sub(zero, step));
    let changes_sign = lanes.or(lanes.and_not(was_above, rises), lanes.and_not(rises, was_above));
    let moderate = lanes.is_at_least(lanes.word(MAX_COLUMN_STEP as i16), step);
    lanes.and(lanes.and(before.known, after.known), lanes.and(changes_sign, moderate))
}

/// One crossing per pixel.
#[derive(Clone, Copy)]
pub(in crate::correspondence) struct Crossing<L: Lanes> {
    /// Pixels with a crossing.
    pub(in crate::correspondence) hit: L::Mask,
    /// Phase differences in the columns before and after it.
    pub(in crate::correspondence) before: L::Words,
    pub(in crate::correspondence) after: L::Words,
    /// The column after the crossing.
    pub(in crate::correspondence) after_at: L::Words,
}

impl<L: Lanes> Crossing<L> {
    #[inline(always)]
    pub(in crate::correspondence) fn none(lanes: L) -> Self {
        let zero = lanes.word(0);
        Self { hit: lanes.mask(0), before: zero, after: zero, after_at: zero }
    }

    /// Sets the crossings of some pixels, which may replace earlier ones.
    #[inline(always)]
    pub(in crate::correspondence) fn set(
        &mut self,
        lanes: L,
        pixels: L::Mask,
        before: L::Words,
        after: L::Words,
        at: L::Words,
    ) {
        self.hit = lanes.or(self.hit, pixels);
        self.before = lanes.select(pixels, before, self.before);
        self.after = lanes.select(pixels, after, self.after);
        self.after_at = lanes.select(pixels, at, self.after_at);
    }
}

/// Sub-pixel column of each crossing and the slope of the phase there.
#[inline(always)]
pub(in crate::correspondence) fn column_and_slope<L: Lanes>(lanes: L, crossing: &Crossing<L>) -> (L::Floats, L::Longs) {
    let (before, after) = (lanes.widen(crossing.before), lanes.widen(crossing.after));
    let slope = lanes.sub_long(after, before);
    let down = lanes.floats(lanes.sub_long(before, after));
    let offset = lanes.over(lanes.floats(before), down);
    let column = lanes.widen_unsigned(lanes.sub(crossing.after_at, lanes.word(1)));
    (lanes.add_float(lanes.floats(column), offset), slope)
}
