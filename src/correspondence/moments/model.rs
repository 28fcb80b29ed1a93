//! The constants of the order decision, and its steps: what they are, and how to measure what each is worth.

/// Defines [`Model`] from a list of constants with their descriptions, values and units.
macro_rules! model {
    ($($(#[doc = $text:literal])+ $name:ident: $value:literal $unit:literal,)+) => {
        /// The constants of the order decision. Others than the defaults are for measuring what each is worth.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Model {
            $($(#[doc = $text])+ pub $name: f32,)+
            /// A step that is left out.
            pub without: Option<Step>,
        }

        impl Model {
            /// The constants that the method has, and all its steps.
            pub const USUAL: Self = Self { $($name: $value,)+ without: None };
            /// All constants.
            pub const CONSTANTS: &[Constant] = &[$(Constant {
                name: stringify!($name),
                unit: $unit,
                text: concat!($($text),+),
                of: |model| &mut model.$name,
            }),+];
        }
    };
}

/// A constant of the model.
#[derive(Clone, Copy, Debug)]
pub struct Constant {
    /// Name of its field.
    pub name: &'static str,
    /// Its unit; empty for a plain number.
    pub unit: &'static str,
    /// What it is.
    pub text: &'static str,
    /// Its place in a model.
    pub of: fn(&mut Model) -> &mut f32,
}

/// A step that can be left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The second search of the field, with a wide prior.
    WideSearch,
    /// Smaller tiles for what is open.
    SmallerTiles,
    /// The message of decided pixels beside a node.
    Contacts,
    /// Opening components again whose means speak against them.
    Reopening,
    /// Adoption of open pixels by their neighbours.
    Adoption,
    /// The share of free places in C2 as evidence.
    FreePlaces,
    /// One place of C2 holds one point.
    Claims,
}

impl Step {
    /// All steps.
    pub const ALL: [Self; 7] = [
        Self::WideSearch,
        Self::SmallerTiles,
        Self::Contacts,
        Self::Reopening,
        Self::Adoption,
        Self::FreePlaces,
        Self::Claims,
    ];

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::WideSearch => "wide search of the field",
            Self::SmallerTiles => "smaller tiles",
            Self::Contacts => "contacts of nodes",
            Self::Reopening => "reopening",
            Self::Adoption => "adoption",
            Self::FreePlaces => "free places",
            Self::Claims => "claims on places",
        }
    }
}

impl Model {
    /// Whether a step is done.
    #[must_use]
    pub fn does(&self, step: Step) -> bool {
        self.without != Some(step)
    }
}

model! {
    /// Bend of the phase beyond which a surface ends, if both sides of a step bend so
    max_bend_turns: 0.0336 "turns",
    /// The same as a multiple of the sd of bends that the noise of the phase makes
    bend_sd: 2.5 "",
    /// Greatest step from row to row at which runs are united
    max_row_step_turns: 0.137 "turns",
    /// sd of a mode of the error field, as calibration error of a pixel
    prior_px: 0.15 "px",
    /// The same in the wide search
    wide_prior_px: 1.0 "px",
    /// Reach of δ of a fitting sample about no field
    first_cap_rad: 0.3 "rad",
    /// The same in the wide search
    wide_cap_rad: 0.8 "rad",
    /// Reach of δ of a fitting sample about the field
    cap_rad: 0.2 "rad",
    /// sd of the mean of a true order about no field
    first_mean_rad: 0.06 "rad",
    /// sd of the means of nodes from which on the field is wrong: true orders leave about .01, wrong ones .017 to .1
    scattered_rad: 0.02 "rad",
    /// sd of the mean of a node about the field in its fit
    node_mean_rad: 0.04 "rad",
    /// Nodes of a scene count as so many independent ones where explanations are compared
    independent_nodes: 16.0 "",
    /// Distance at which a node no longer counts in the fit
    tukey_sd: 4.7 "sd",
    /// Ratio and lead of nodes from which field, noise and widths are learned
    clear_nats: 3.0 "nats",
    /// Least share of fitting samples of such a node
    clear_share: 0.7 "",
    /// Least width of mean and slopes of true orders
    min_width_rad: 0.01 "rad",
    /// Greatest one
    max_width_rad: 0.04 "rad",
    /// Spread of the mean of a wrong order from one largest tile to the next
    wrong_mean_rad: 0.8 "rad",
    /// Exponent of the density of the share of fitting samples of a true order
    share_exponent: 6.0 "",
    /// Least share of fitting samples
    min_share: 0.3 "",
    /// Least share of samples that C2 must see
    min_seen: 0.2 "",
    /// Least ratio: one spoilt node must not outweigh all its neighbours
    floor_nats: -5.0 "nats",
    /// Ratio of an order that C2 does not see: to be hidden or beyond its image says nothing, but to be seen is likelier
    unseen_nats: -0.5 "nats",
    /// Ratio of no order at all
    nothing_nats: -1.0 "nats",
    /// Price of a change of order along a surface in the largest tiles; it falls with the root of the side
    price_nats: 5.0 "nats",
    /// Price of a pixel of the cut at which a component breaks the surface of a better founded one
    break_nats: 0.05 "nats",
    /// Handicap of an order outside the volume for a whole surface
    outside_nats: 30.0 "nats",
    /// Its greatest share for a node
    outside_node_nats: 4.0 "nats",
    /// Least ratio of a component of nodes that is looked at, and lead of another order of a node that holds two surfaces
    look_nats: 4.0 "nats",
    /// Excess from which on a node holds two surfaces and waits for smaller tiles
    pure_sd: 4.0 "sd",
    /// Pixels of a part from which on it counts fully
    full_px: 64.0 "px",
    /// Largest distance of δ of a decided pixel
    max_sd: 6.0 "sd",
    /// How far the line of phases is continued at a rim
    rim_px: 1.0 "px",
    /// How far δ of an adopted pixel may be off at least: at a rim two surfaces mix
    rim_rad: 0.2 "rad",
    /// Width of the means of nodes within a true component
    true_means_rad: 0.015 "rad",
    /// The same within a wrong one
    wrong_means_rad: 0.06 "rad",
    /// Exponent of the density of the share of free places of a true surface, and of claims around a contested place
    free_exponent: 8.0 "",
    /// What it is worth to be the nearer one of two surfaces
    nearer_nats: 1.5 "nats",
}
