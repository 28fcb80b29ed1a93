//! Draws a cloud as seen by C1: depth in colours, hill-shaded.

use fringeflow::cloud::Cloud;

use super::colour::{BACKGROUND, Rgb, sequential, shaded};
use super::picture::Picture;
use super::scale::with_scale;
use super::shading::PointMap;

/// Share of the points that is clipped at each end of the depth range, so that outliers do not stretch the colours.
const CLIPPED_SHARE: f64 = 0.005;

/// Draws the depth z of the points at their pixels of C1: yellow is near, violet is far, shaded as if lit from the
/// upper left. A scale in millimetres is drawn below.
///
/// `size_px` is the size of the images of C1 (width, height). Points outside are skipped.
#[must_use]
pub fn depth_picture(cloud: &Cloud, size_px: [usize; 2]) -> Picture {
    let map = point_map(cloud, size_px);
    let [near_m, far_m] = depth_range(&map);
    let picture = Picture::from_fn(size_px, |i| match map.points_m[i] {
        Some(point) => {
            let brightness = map.brightness(i % map.width, i / map.width, point);
            shaded(depth_colour((point[2] - near_m) / (far_m - near_m)), brightness)
        }
        None => BACKGROUND,
    });
    let labels = [near_m, far_m].map(|depth_m| format!("{:.0} mm", depth_m * 1000.0));
    with_scale(picture, &labels, depth_colour)
}

fn point_map(cloud: &Cloud, [width, height]: [usize; 2]) -> PointMap {
    let mut points_m = vec![None; width * height];
    for point in &cloud.points {
        let [u, v] = point.cam1_px.map(usize::from);
        if u < width && v < height && point.position_m.iter().all(|c| c.is_finite()) {
            points_m[v * width + u] = Some(point.position_m);
        }
    }
    PointMap { width, height, points_m }
}

/// Returns the range of depths for the colours. Its ends always differ.
fn depth_range(map: &PointMap) -> [f32; 2] {
    let mut depths: Vec<f32> = map.points_m.iter().flatten().map(|p| p[2]).collect();
    if depths.is_empty() {
        return [0.0, 1.0];
    }
    let clipped = (depths.len() as f64 * CLIPPED_SHARE) as usize;
    let mut at = |rank: usize| *depths.select_nth_unstable_by(rank, f32::total_cmp).1;
    let near = at(clipped);
    let far = at(map.points_m.iter().flatten().count() - 1 - clipped);
    [near, far.max(near + 1e-4)]
}

fn depth_colour(share: f32) -> Rgb {
    // The darkest part of the map would vanish in the shading.
    sequential(1.0 - 0.85 * share.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::cloud::CloudPoint;

    const SIZE: [usize; 2] = [121, 101];

    /// A plane at 0.5 m with a bump of 10 mm towards the camera in the middle; 1 mm per pixel.
    fn bump() -> Cloud {
        let points = (0..SIZE[0] * SIZE[1]).map(|i| {
            let [u, v] = [i % SIZE[0], i / SIZE[0]];
            let [x, y] = [u as f32 - 60.0, v as f32 - 50.0];
            let z = 500.0 - 10.0 * (-(x * x + y * y) / 400.0).exp();
            CloudPoint {
                position_m: [x * 1e-3, y * 1e-3, z * 1e-3],
                intensity: 128,
                cam1_px: [u as u16, v as u16],
                ..CloudPoint::default()
            }
        });
        Cloud { points: points.collect() }
    }

    fn brightness(picture: &Picture, u: usize, v: usize) -> u32 {
        picture.pixels()[v * SIZE[0] + u].iter().map(|&c| u32::from(c)).sum()
    }

    #[test]
    fn a_bump_is_brighter_on_the_lit_side() {
        let picture = depth_picture(&bump(), SIZE);
        // Both are equally far from the summit, so they have the same depth and the same colour before shading.
        let [lit, averted] = [brightness(&picture, 50, 40), brightness(&picture, 70, 60)];
        assert!(lit * 4 > averted * 5, "lit {lit}, averted {averted}");
    }

    #[test]
    fn pixels_without_points_are_background() {
        let mut cloud = bump();
        cloud.points.retain(|p| p.cam1_px[0] != 30);
        let picture = depth_picture(&cloud, SIZE);
        let missing = (0..SIZE[1]).map(|v| picture.pixels()[v * SIZE[0] + 30]);
        assert!(missing.clone().all(|p| p == BACKGROUND));
        let drawn = picture.pixels()[..SIZE[0] * SIZE[1]].iter().filter(|&&p| p != BACKGROUND);
        assert_eq!(drawn.count(), cloud.points.len());
        assert_eq!(picture.size_px()[0], SIZE[0]);
    }

    #[test]
    fn an_outlier_does_not_stretch_the_colours() {
        let cloud = bump();
        let mut with_outlier = cloud.clone();
        with_outlier.points[0].position_m = [0.0, 0.0, 50.0];
        let [a, b] = [cloud, with_outlier].map(|c| depth_range(&point_map(&c, SIZE)));
        assert!((a[1] - b[1]).abs() < 1e-3 && (a[0] - b[0]).abs() < 1e-3, "{a:?} {b:?}");
    }

    #[test]
    fn empty_clouds_and_points_outside_are_dark() {
        let mut cloud = bump();
        for point in &mut cloud.points {
            point.cam1_px[0] += 121;
        }
        for cloud in [cloud, Cloud::default()] {
            let picture = depth_picture(&cloud, SIZE);
            assert!(picture.pixels()[..SIZE[0] * SIZE[1]].iter().all(|&p| p == BACKGROUND));
        }
    }
}
