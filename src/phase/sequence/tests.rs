use std::f64::consts::TAU;

use fringeflow_base::grey::GreyLevels;

use crate::phase::Validity;

use super::{SequenceCheck, SequenceFault, SequenceFaultKind, SequenceScratch};

const WIDTH: usize = 96;
const HEIGHT: usize = 80;

/// Grey level of a pixel in an image with a phase shift.
type Scene = fn(pixel: [usize; 2], shift_rad: f64, image: usize) -> f64;

fn resting([u, v]: [usize; 2], shift_rad: f64, _: usize) -> f64 {
    let texture = 0.7 + 0.3 * (0.13 * u as f64 + 0.31 * v as f64).sin();
    texture * (100.0 + 70.0 * (0.6 * u as f64 + 0.05 * v as f64 + shift_rad).cos())
}

/// Noise of about a grey level, the same for the same image.
fn noise(pixel: usize, image: usize) -> f64 {
    let hash = (pixel as u64 * 0x9e37_79b9 + image as u64 * 0x85eb_ca6b + 77).wrapping_mul(0xc2b2_ae35_27d4_eb4f);
    3.4 * ((hash >> 40) as f64 / f64::from(1_u32 << 24) - 0.5)
}

/// The fault found in images that show these steps of N.
fn found_fault(steps: usize, shown: &[usize], scene: Scene) -> Option<SequenceFaultKind> {
    found_fault_in(&mut SequenceScratch::default(), steps, shown, scene).map(|fault| fault.kind)
}

fn found_fault_in(scratch: &mut SequenceScratch, steps: usize, shown: &[usize], scene: Scene) -> Option<SequenceFault> {
    let images: Vec<Vec<u8>> = shown
        .iter()
        .enumerate()
        .map(|(i, &step)| {
            let shift_rad = TAU * step as f64 / steps as f64;
            let grey = |pixel: usize| scene([pixel % WIDTH, pixel / WIDTH], shift_rad, i) + noise(pixel, i);
            (0..WIDTH * HEIGHT).map(|pixel| grey(pixel).round().clamp(0.0, 255.0) as u8).collect()
        })
        .collect();
    let cycle: Vec<f64> = (0..steps).map(|k| TAU * k as f64 / steps as f64).collect();
    let levels: Vec<GreyLevels<'_>> = images.iter().map(|bytes| GreyLevels::eight_bit(bytes)).collect();
    let check = SequenceCheck::new(&cycle, 0, shown.len());
    check.find_fault_in(scratch, &levels, WIDTH, HEIGHT, &Validity::default())
}

#[test]
fn old_scratch_memory_does_not_matter() {
    let mut scratch = SequenceScratch::default();
    let flicker: Scene =
        |pixel, shift_rad, image| resting(pixel, shift_rad, image) * if image % 3 == 0 { 0.8 } else { 1.0 };
    let dark: Scene = |_, _, _| 3.0;
    for (steps, shown, scene) in [
        (8, vec![0, 1, 2, 3, 7, 8, 9, 10, 11, 12], resting as Scene),
        (4, vec![0, 1, 2, 4, 5, 6], resting),
        (4, vec![0, 1, 2, 3, 4, 5], dark),
        (4, vec![0, 2, 1, 3, 4, 5], flicker),
        (4, vec![0, 1, 2, 3, 4, 5], resting),
        (5, vec![0, 1, 2, 4, 3, 5, 6], resting),
    ] {
        let fresh = found_fault_in(&mut SequenceScratch::default(), steps, &shown, scene);
        assert_eq!(found_fault_in(&mut scratch, steps, &shown, scene), fresh, "{shown:?}");
    }
}

#[test]
fn faults_at_rest_are_named() {
    assert_eq!(found_fault(4, &[0, 1, 2, 3, 4, 5], resting), None);
    let lost = |after, images| Some(SequenceFaultKind::Lost { after, images });
    assert_eq!(found_fault(4, &[0, 1, 3, 4, 5, 6], resting), lost(1, 1));
    assert_eq!(found_fault(8, &[0, 1, 2, 3, 7, 8, 9, 10, 11, 12], resting), lost(3, 3));
    let twice = Some(SequenceFaultKind::Duplicated { image: 2 });
    assert_eq!(found_fault(4, &[0, 1, 2, 2, 3, 4], resting), twice);
    assert_eq!(found_fault(8, &[0, 1, 2, 2, 3, 4, 5, 6, 7, 8], resting), twice);
    assert_eq!(found_fault(4, &[0, 2, 1, 3, 4, 5], resting), Some(SequenceFaultKind::Swapped { first: 1 }));
    assert_eq!(found_fault(5, &[0, 1, 2, 4, 3, 5, 6], resting), Some(SequenceFaultKind::Swapped { first: 3 }));
}

#[test]
fn a_loss_that_looks_like_motion_is_found_if_the_scene_rests() {
    let check = SequenceCheck::new(&[0.0, TAU / 4.0, TAU / 2.0, 0.75 * TAU], 0, 6);
    let kind = SequenceFaultKind::Lost { after: 2, images: 1 };
    // 0 1 2 0 1 2 looks like N = 3: every step seems to be π/6 larger.
    assert!(check.residual_share(kind, 0.0) < 0.01);
    assert!(check.residual_share(kind, 0.1) > check.least_residual_share());
    assert_eq!(found_fault(4, &[0, 1, 2, 4, 5, 6], resting), Some(kind));
}

#[test]
fn steps_that_are_all_ahead_alike_are_no_fault() {
    assert_eq!(found_fault(4, &[1, 2, 3, 4, 5, 6], resting), None);
    // A whole cycle lost.
    assert_eq!(found_fault(4, &[0, 1, 2, 7, 8, 9], resting), None);
}

#[test]
fn an_image_that_shows_something_else_is_named() {
    let covered: Scene = |pixel, shift_rad, image| {
        let [u, v] = pixel;
        if image == 3 {
            90.0 + 60.0 * (0.37 * u as f64 - 0.21 * v as f64).sin()
        } else {
            resting(pixel, shift_rad, image)
        }
    };
    assert_eq!(found_fault(8, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9], covered), Some(SequenceFaultKind::Wrong { image: 3 }));
}

#[test]
fn images_in_no_order_are_refused() {
    let fault = found_fault(8, &[0, 3, 6, 1, 4, 7, 2, 5, 1, 6], resting);
    assert_eq!(fault, Some(SequenceFaultKind::Unexplained));
}

#[test]
fn motion_edges_and_flicker_are_no_faults() {
    for steps in [4, 8] {
        let shown: Vec<usize> = (0..steps + 2).collect();
        let moving: Scene =
            |[u, v], shift_rad, image| resting([u, v], shift_rad + (0.1 + 0.003 * u as f64) * image as f64, image);
        assert_eq!(found_fault(steps, &shown, moving), None, "{steps} steps, motion");
        let edge: Scene = |[u, v], shift_rad, image| {
            let further = if u < 12 + 4 * image { 2.0 } else { 0.0 };
            resting([u, v], shift_rad + further, image)
        };
        assert_eq!(found_fault(steps, &shown, edge), None, "{steps} steps, edge");
        let flicker: Scene =
            |pixel, shift_rad, image| resting(pixel, shift_rad, image) * if image % 3 == 0 { 0.8 } else { 1.0 };
        assert_eq!(found_fault(steps, &shown, flicker), None, "{steps} steps, flicker");
        let dark: Scene = |_, _, _| 3.0;
        assert_eq!(found_fault(steps, &shown, dark), None, "{steps} steps, darkness");
    }
}
