//! The scale of matching costs, and the table of the cost by z.
//!
//! A candidate with z = (δ − drift)/sd costs −ln(e⁻⁵ + e^(−z²/2)): that of a normal error, but at most five nats, since
//! the true candidate may be missing or spoilt.

/// Costs are whole numbers in steps of 1/20 nat.
pub(super) const UNITS_PER_NAT: f32 = 20.0;
/// Matching cost of an order without candidate, nats.
const MISSING_NATS: f32 = 5.0;
/// Matching cost of an order without candidate, in whole numbers.
pub(super) const MISSING: u8 = (MISSING_NATS * UNITS_PER_NAT) as u8;
/// Stands for an order that a pixel does not have.
pub(super) const NO_ORDER: u8 = u8::MAX;
/// Additional cost of a candidate outside the measurement volume, nats.
const OUTSIDE_NATS: f32 = 0.2;
pub(super) const OUTSIDE: u8 = (OUTSIDE_NATS * UNITS_PER_NAT) as u8;
/// Stands for the least cost of a decided pixel.
pub(super) const DECIDED: u8 = NO_ORDER - DECIDED_LEAD;
/// Excess of all other orders of a decided pixel.
pub(super) const DECIDED_LEAD: u8 = MISSING;
/// Largest z with a cost of its own; beyond it the candidate counts as missing.
pub(super) const MAX_Z: f32 = 5.0;
/// Steps of the cost table per unit of z.
pub(super) const STEPS_PER_Z: f32 = 64.0;
/// z of the back-projection test (paper, section 2.1).
pub(super) const PASSING_Z: f32 = 3.0;

/// Table of the matching cost by z.
pub(super) struct CostTable {
    /// The last is that of a missing candidate.
    pub(super) of_step: [i32; Self::STEPS + 1],
    /// An order whose cost is below this passes the back-projection test.
    pub(super) limit: u8,
}

impl CostTable {
    /// Number of steps with a cost of their own.
    pub(super) const STEPS: usize = (MAX_Z * STEPS_PER_Z) as usize;

    pub(super) fn new() -> Self {
        let of_step = std::array::from_fn(|step| {
            let z = (step as f64 + 0.5) / f64::from(STEPS_PER_Z);
            let nats = -((-f64::from(MISSING_NATS)).exp() + (-0.5 * z * z).exp()).ln();
            let cost = (nats.max(0.0) * f64::from(UNITS_PER_NAT)).round() as i32;
            if step < Self::STEPS { cost } else { i32::from(MISSING) }
        });
        Self { of_step, limit: of_step[(PASSING_Z * STEPS_PER_Z) as usize] as u8 }
    }
}
