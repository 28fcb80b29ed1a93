//! Files that are cut, flipped, or lie.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;

fn small_recording(folder: &Folder) -> Vec<u8> {
    let recorder =
        Recorder::create(&folder.path("small.mcap"), &opening(&Origin::default()), DEFAULT_QUEUE_BYTES).unwrap();
    for sequence in 0..3 {
        for camera in [1, 2] {
            let header = frame(camera, sequence);
            recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
        }
        recorder.push(&Recordable::Report(&report()));
    }
    recorder.push(&Recordable::Cloud { header: &cloud(3), records: &[0; 3 * 37] });
    recorder.push(&Recordable::Mark { time_ns: 1, text: "here" });
    std::fs::read(recorder.finish().unwrap().file).unwrap()
}

/// Opens it and reads everything in it; true if nothing was found wrong.
fn read_through(path: &Path) -> bool {
    Recording::open(path).is_ok_and(|recording| recording.messages().all(|message| message.is_ok()))
}

#[test]
fn a_flipped_byte_anywhere_is_found() {
    let folder = Folder::new();
    let intact = small_recording(&folder);
    let path = folder.path("flipped.mcap");
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for round in 0..600 {
        let mut bytes = intact.clone();
        let places: Vec<usize> = (0..1 + round % 4).map(|_| random.random_range(0..bytes.len())).collect();
        places.iter().for_each(|&place| bytes[place] ^= random.random_range(1..=255));
        std::fs::write(&path, &bytes).unwrap();
        assert!(bytes == intact || !read_through(&path), "flips at {places:?} went unnoticed");
    }
}

#[test]
fn a_cut_file_is_unfinished_wherever_it_is_cut() {
    let folder = Folder::new();
    let intact = small_recording(&folder);
    let path = folder.path("cut.mcap");
    for end in (0..intact.len()).step_by(997) {
        std::fs::write(&path, &intact[..end]).unwrap();
        let problem = problem(&path);
        let is_named = match problem {
            RecordingProblem::NotMcap => end < 8,
            RecordingProblem::Unfinished { offset, .. } => offset == end as u64,
            _ => false,
        };
        assert!(is_named, "cut at {end}: {problem}");
    }
    std::fs::write(&path, [intact.as_slice(), b"more"].concat()).unwrap();
    assert!(matches!(problem(&path), RecordingProblem::Damaged { .. }));
}
