//! Evidence and selection of 32 pixels of a row at once, by AVX-512: what [`super::outlook`] says of each, bit for bit.
//!
//! As in the projector-side search, neighbouring pixels look for one order in neighbouring columns of the same rows of C2,
//! which registers hold. Every operation is that of the scalar form, single and in its order. Pixels of which more cannot be
//! said are *irregular*, and left to it: Φ that hardly changes or runs into its pole, intervals of many columns or at the
//! border of the image, rows of C2 that lie apart.
#![allow(unsafe_code, reason = "instructions of the level")]

mod evidence;
mod half;
mod selection;

use std::arch::x86_64::*;

use crate::simd::Avx512;

use super::super::drift::DepthRow;
use super::super::epipolar_image::EpipolarImage;
pub(super) use super::super::registers::BLOCK;
use super::super::registers::{Differences, Rows, join, load_bytes, load_floats, load_words, widen};
use super::super::segment::SegmentRow;
use super::outlook::FLAT_TURNS;
use super::windows::{LANE_STEP, Windows};

use evidence::{Columns, Crossings};
use half::Half;
pub(super) use selection::Found;
use selection::MAX_DIFFERENCES;

/// Greatest Φ that is believed, turns: what lies beyond has met its pole.
const MAX_TURNS: f32 = 1e4;

/// A row of pixels and what it is searched in.
pub(super) struct Row<'a> {
    pub(super) image: &'a EpipolarImage,
    pub(super) segments: &'a SegmentRow,
    pub(super) drift: &'a DepthRow,
    pub(super) windows: &'a Windows,
    pub(super) phase: &'a [u16],
    /// sd of δ of each pixel, turns.
    pub(super) sd_turns: &'a [f32],
}

/// Room for what is found on the way, to be used from block to block.
pub(super) struct Room {
    columns: [Columns; LANE_STEP],
    crossings: Crossings,
    differences: [Differences; MAX_DIFFERENCES],
}

impl Room {
    pub(super) fn new() -> Self {
        let differences = [Differences::NONE; MAX_DIFFERENCES];
        Self { columns: [Columns::NONE; LANE_STEP], crossings: Crossings::NONE, differences }
    }
}

/// Pixels of a row from a column on, made ready to be asked about their orders.
pub(super) struct Block<'a> {
    image: &'a EpipolarImage,
    halves: [Half; 2],
    rows: Rows,
    phases: __m512i,
    /// Pixels that are asked about.
    pub(super) regular: u32,
    /// Pixels left to the scalar form.
    pub(super) irregular: u32,
}

impl<'a> Row<'a> {
    /// A block without pixels.
    pub(super) fn no_block(&self) -> Block<'a> {
        let halves = [Half::NONE; 2];
        Block { image: self.image, halves, rows: Rows::NONE, phases: Differences::NONE.value, regular: 0, irregular: 0 }
    }

    /// Turns a block to the pixels from `first` on, which have so many orders each; yields whether any has one.
    #[inline]
    pub(super) fn turn(&self, _: Avx512, block: &mut Block<'_>, first: usize, count: &[u8; BLOCK]) -> bool {
        // SAFETY: the lanes prove that the machine has the instructions.
        unsafe { self.turn_of_level(block, first, count) }
    }

    #[target_feature(
        enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512cd,avx512vbmi,avx512vnni,bmi1,bmi2,lzcnt,popcnt"
    )]
    fn turn_of_level(&self, block: &mut Block<'_>, first: usize, count: &[u8; BLOCK]) -> bool {
        let counts = load_bytes(count);
        let wanted = _mm256_test_epi8_mask(counts, counts);
        if wanted == 0 {
            return false;
        }
        let [low, high] = &mut block.halves;
        let regular = join([self.turn_half(low, first), self.turn_half(high, first + 16)]);
        let regular = if self.image.width > i16::MAX as usize { 0 } else { regular & wanted };
        let mut irregular = wanted & !regular;
        block.rows = Rows::of(self.image, [block.halves[0].row, block.halves[1].row], regular, &mut irregular);
        let mut phase = [0; BLOCK];
        phase.copy_from_slice(&self.phase[first..first + BLOCK]);
        block.phases = load_words(&phase);
        (block.regular, block.irregular) = (wanted & !irregular, irregular);
        true
    }

    /// Turns half a block to the pixels from `first` on; yields those that are regular.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    fn turn_half(&self, half: &mut Half, first: usize) -> u16 {
        let (s, drift) = (self.segments, self.drift);
        let load = |from: &[f32]| load_floats(&from[first..first + 16]);
        (half.begin, half.end) = (load(&s.begin_px), load(&s.end_px));
        let beyond = _mm512_set1_ps(self.windows.reach.beyond_px);
        half.first_px = _mm512_max_ps(_mm512_sub_ps(half.begin, beyond), _mm512_setzero_ps());
        let last_column_px = _mm512_set1_ps(self.windows.reach.last_column_px);
        half.last_px = _mm512_min_ps(_mm512_add_ps(half.end, beyond), last_column_px);
        let mut words = [0; 16];
        words.copy_from_slice(&self.phase[first..first + 16]);
        half.phase_turns = _mm512_mul_ps(_mm512_cvtepi32_ps(widen(words)), _mm512_set1_ps(1.0 / 65536.0));
        (half.reference, half.row) = (load(&s.reference_px), load(&s.row_px));
        (half.a, half.b, half.d) = (load(&s.a), load(&s.b), load(&s.d));
        half.rise = _mm512_sub_ps(half.b, _mm512_mul_ps(half.a, half.d));
        let c = &drift.coefficients;
        half.drift = [load(&c[0]), load(&c[1]), load(&c[2]), load(&c[3]), load(&c[4]), load(&c[5])];
        (half.middle_px, half.per_px) = (load(&drift.middle_px), _mm512_set1_ps(drift.per_px));
        half.sd_turns = load(self.sd_turns);
        let (at_first, at_last) = (half.phase_turns_at(half.first_px), half.phase_turns_at(half.last_px));
        half.least = _mm512_min_ps(at_first, at_last);
        half.most = _mm512_max_ps(at_first, at_last);
        let is_small =
            |turns: __m512| _mm512_cmp_ps_mask::<_CMP_LT_OQ>(_mm512_abs_ps(turns), _mm512_set1_ps(MAX_TURNS));
        let rises = _mm512_sub_ps(half.most, half.least);
        is_small(at_first)
            & is_small(at_last)
            & _mm512_cmp_ps_mask::<_CMP_GT_OQ>(rises, _mm512_set1_ps(FLAT_TURNS))
            & _mm512_cmp_ps_mask::<_CMP_GT_OQ>(half.sd_turns, _mm512_setzero_ps())
    }
}

impl Block<'_> {
    /// Leaves pixels to the scalar form.
    #[inline(always)]
    fn give_up(&mut self, pixels: u32) {
        self.irregular |= pixels;
        self.regular &= !pixels;
    }
}
