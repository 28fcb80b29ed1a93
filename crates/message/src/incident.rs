//! What happened to a stage beside its items: faults that were survived.

/// Something that went wrong, or nearly, without being an item: counted, never dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
pub enum Incident {
    /// The camera sent nothing for longer than its time-out.
    TimeOut = 0,
    /// A signal cut a wait or a call short; it was made again.
    Interrupted = 1,
    /// The driver refused a call that it should not have.
    CallRefused = 2,
    /// The stream was stopped and begun anew.
    StreamRestart = 3,
    /// The camera was unplugged.
    Unplugged = 4,
    /// The camera was there again, under whatever number.
    Returned = 5,
    /// The driver's numbers of the images began anew.
    NumberingRestart = 6,
    /// A time stamp lay after the arrival of its image.
    StampAhead = 7,
    /// Time stamps ran back, or are of no known clock; times were reckoned from an arrival.
    StampJump = 8,
}

impl Incident {
    /// All incidents.
    pub const ALL: [Self; 9] = [
        Self::TimeOut,
        Self::Interrupted,
        Self::CallRefused,
        Self::StreamRestart,
        Self::Unplugged,
        Self::Returned,
        Self::NumberingRestart,
        Self::StampAhead,
        Self::StampJump,
    ];

    /// Name in reports, metrics and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::TimeOut => "time_out",
            Self::Interrupted => "interrupted",
            Self::CallRefused => "call_refused",
            Self::StreamRestart => "stream_restart",
            Self::Unplugged => "unplugged",
            Self::Returned => "returned",
            Self::NumberingRestart => "numbering_restart",
            Self::StampAhead => "stamp_ahead",
            Self::StampJump => "stamp_jump",
        }
    }
}
