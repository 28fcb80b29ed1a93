//! Faults that a stage survived.

use crate::codes::codes;

codes! {
    /// A fault, or nearly one, that does not concern a single item. Incidents are counted; they do not cause items to
    /// be dropped.
    pub enum Incident {
        TimeOut = 0, "time_out", "no image for longer than the time-out";
        Interrupted = 1, "interrupted", "a signal interrupted a call; the call was repeated";
        CallRefused = 2, "call_refused", "the driver refused a call";
        StreamRestart = 3, "stream_restart", "the stream was stopped and restarted";
        Unplugged = 4, "unplugged", "the camera was unplugged";
        Returned = 5, "returned", "the camera is connected again";
        NumberingRestart = 6, "numbering_restart", "the sequence numbers of the driver started again";
        StampAhead = 7, "stamp_ahead", "a time stamp was later than the arrival of its image";
        StampJump = 8, "stamp_jump", "time stamps ran backwards or came from an unknown clock";
        Skewed = 9, "skewed", "the cameras began to expose farther apart than cameras.max_skew_us";
    }
}
