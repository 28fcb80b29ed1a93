//! Explains why a window took long, as a sentence for people.

use std::fmt;

use super::Segment;

/// The segment that exceeds its median duration over the run by most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cause {
    /// The segment.
    pub segment: Segment,
    /// Duration of the segment in this window, milliseconds.
    pub ms: f64,
    /// Median duration of the segment over the run, milliseconds.
    pub median_ms: f64,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = Milliseconds(self.ms);
        match self.segment {
            Segment::Camera => write!(f, "camera and driver took {ms} from exposure to image")?,
            Segment::Pairing => write!(f, "waited {ms} for the other camera or the pattern")?,
            Segment::Phase => write!(f, "phase took {ms}")?,
            Segment::CorrespondenceQueue => write!(f, "waited {ms} for the correspondence stage")?,
            Segment::Correspondence => write!(f, "correspondence took {ms}")?,
            Segment::CloudQueue => write!(f, "waited {ms} for the cloud stage")?,
            Segment::Cloud => write!(f, "cloud took {ms}")?,
        }
        write!(f, " (median {})", Milliseconds(self.median_ms))
    }
}

/// A duration, rounded to a readable number of digits.
struct Milliseconds(f64);

impl fmt::Display for Milliseconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = if self.0 >= 99.95 { 0 } else { 1 };
        write!(f, "{:.digits$} ms", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_is_a_sentence() {
        let cause = |segment, ms, median_ms| Cause { segment, ms, median_ms }.to_string();
        assert_eq!(cause(Segment::Correspondence, 412.3, 180.0), "correspondence took 412 ms (median 180 ms)");
        assert_eq!(
            cause(Segment::CorrespondenceQueue, 90.04, 0.26),
            "waited 90.0 ms for the correspondence stage (median 0.3 ms)"
        );
    }
}
