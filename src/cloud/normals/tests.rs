//! Normals of surfaces before a pinhole camera.

use super::*;

/// Width and height of the image, pixels: the width is no multiple of the lanes.
const SIZE_PX: [usize; 2] = [77, 53];
/// Focal length, pixels. A pixel is 1.3 mm wide at 0.3 m.
const FOCAL_PX: f32 = 230.0;

/// Points of a surface: `depth_m` gives the depth along the ray (ρ, η, 1), or none. `noise_m` is its standard deviation.
fn points_of(noise_m: f32, depth_m: impl Fn(f32, f32) -> Option<f32>) -> Vec<CloudPoint> {
    let mut points = Vec::new();
    for v in 0..SIZE_PX[1] as u16 {
        for u in 0..SIZE_PX[0] as u16 {
            let [x, y] = [(f32::from(u) - 38.0) / FOCAL_PX, (f32::from(v) - 26.0) / FOCAL_PX];
            let Some(depth_m) = depth_m(x, y) else { continue };
            let z = depth_m + noise_m * noise([u, v]);
            let point = CloudPoint {
                position_m: [x * z, y * z, z],
                cam1_px: [u, v],
                sigma_m: noise_m,
                ..CloudPoint::default()
            };
            points.push(point);
        }
    }
    points
}

/// A number of mean 0 and standard deviation 1 that looks random: the sum of twelve uniform ones.
fn noise([u, v]: [u16; 2]) -> f32 {
    let mut state = u32::from(u) * 7919 + u32::from(v) * 104_729 + 1;
    let mut uniform = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    (0..12).map(|_| uniform()).sum::<f32>() - 6.0
}

/// Depth of the plane `n·X = d` along a ray.
fn plane([a, b, c]: [f32; 3], d: f32) -> impl Fn(f32, f32) -> Option<f32> {
    move |x, y| Some(d / (a * x + b * y + c))
}

fn unit(n: [f32; 3]) -> [f32; 3] {
    let length = n.iter().map(|c| c * c).sum::<f32>().sqrt();
    n.map(|c| c / length)
}

/// Angle between two unit vectors, degrees.
fn angle_deg(a: [f32; 3], b: [f32; 3]) -> f32 {
    let off = [0, 1, 2].map(|i| a[i] - b[i]);
    2.0 * (off.iter().map(|c| c * c).sum::<f32>().sqrt() / 2.0).asin().to_degrees()
}

#[test]
fn a_plane_has_the_same_normal_everywhere() {
    let truth = unit([0.3, -0.4, -0.8]);
    let normals = normals_of(&points_of(0.0, plane(truth, -0.25)));
    assert_eq!(normals.len(), SIZE_PX[0] * SIZE_PX[1]);
    for normal in normals {
        assert!(angle_deg(normal, truth) < 0.02, "{normal:?}");
    }
}

#[test]
fn noise_tilts_normals_by_the_expected_angle() {
    // 0.02 mm over 7 × 7 pixels of 1.3 mm: 0.02 / (1.3 · √(7 · 28)) rad = 0.06°.
    let truth = unit([0.0, -0.2, -1.0]);
    let normals = normals_of(&points_of(2e-5, plane(truth, -0.3)));
    let mean_square =
        normals.iter().map(|&normal| angle_deg(normal, truth).powi(2)).sum::<f32>() / normals.len() as f32;
    assert!((0.04..0.2).contains(&mean_square.sqrt()), "{}°", mean_square.sqrt());
}

#[test]
fn a_step_does_not_bend_the_normals_beside_it() {
    // Two plates parallel to the image, the right one 15 mm nearer.
    let normals = normals_of(&points_of(1e-5, |x, _| Some(if x < 0.0 { 0.315 } else { 0.3 })));
    let (with, without): (Vec<_>, Vec<_>) = normals.into_iter().partition(|&normal| normal != [0.0; 3]);
    assert!(without.len() * 50 < with.len(), "{} points without a normal", without.len());
    for normal in with {
        assert!(angle_deg(normal, [0.0, 0.0, -1.0]) < 1.0, "{normal:?}");
    }
}

#[test]
fn single_points_and_lines_have_no_normal() {
    let line = points_of(0.0, |_, y| (y.abs() < 0.002).then_some(0.3));
    assert_eq!(line.len(), SIZE_PX[0]);
    // A point at the last pixel that a record can name takes no image of that size.
    let far = CloudPoint { cam1_px: [u16::MAX; 2], ..line[0] };
    let normals = normals_of(&line.into_iter().chain([far]).collect::<Vec<_>>());
    assert!(normals.iter().all(|&normal| normal == [0.0; 3]));
}

#[test]
fn parts_of_the_image_do_not_show() {
    // The corner of four tiles lies in the middle.
    let hills = points_of(1e-5, |x, y| Some(0.3 + 0.004 * ((x * 90.0).sin() + (y * 75.0).cos())));
    let shifted: Vec<CloudPoint> =
        hills.iter().map(|p| CloudPoint { cam1_px: [p.cam1_px[0] + 218, p.cam1_px[1] + 230], ..*p }).collect();
    let (normals, shifted) = (normals_of(&hills), normals_of(&shifted));
    assert!(normals.iter().filter(|&&normal| normal != [0.0; 3]).count() > 3000);
    assert_eq!(normals, shifted);
}

#[test]
fn every_level_has_the_same_bits() {
    // Missing points.
    let hills = |x: f32, y: f32| Some(0.3 + 0.004 * ((x * 90.0).sin() + (y * 75.0).cos()));
    let points = points_of(2e-5, |x, y| hills(x, y).filter(|_| (x * 3e4).sin() < 0.6));
    let mut image = PointImage::default();
    image.clear(SIZE_PX);
    assert!(points.iter().all(|point| image.put(point).is_some()));
    let bits_of = |level| {
        let mut normals: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; SIZE_PX[0] * SIZE_PX[1]]);
        compute(level, &image, &mut Vec::new(), &mut normals);
        // The other components of a pixel without a normal mean nothing.
        let [x, y, z] = normals.map(|plane| plane.into_iter().map(f32::to_bits).collect::<Vec<_>>());
        let pixels = x.into_iter().zip(y).zip(z);
        pixels.map(|((x, y), z)| if f32::from_bits(x).is_nan() { [0; 3] } else { [x, y, z] }).collect::<Vec<_>>()
    };
    let expected = bits_of(Level::Portable);
    assert!(expected.iter().filter(|&&bits| bits != [0; 3]).count() > 1000);
    for level in Level::ALL {
        assert_eq!(bits_of(level), expected, "{level:?}");
    }
}
