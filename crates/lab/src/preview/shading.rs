//! Computes surface normals from neighbouring points of a cloud, and shading.

/// Pixels to each side in the fit of a normal, enough to average out the noise of single points.
const REACH: usize = 2;
/// Maximum slope: neighbours with a larger depth difference per lateral distance belong to another surface.
const MAX_SLOPE: f32 = 4.0;
/// Direction of the light in the frame of C1: from the upper left behind the camera.
const LIGHT: [f32; 3] = [-0.36, -0.48, -0.8];
/// Ambient light.
const AMBIENT: f32 = 0.42;

/// Points at the pixels of C1, row by row.
pub(super) struct PointMap {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) points_m: Vec<Option<[f32; 3]>>,
}

impl PointMap {
    /// Brightness of the surface at a pixel that has a point, in [0, 1]; 1 faces the light.
    pub(super) fn brightness(&self, u: usize, v: usize, point_m: [f32; 3]) -> f32 {
        let normal = self.normal(u, v, point_m).unwrap_or([0.0, 0.0, -1.0]);
        AMBIENT + (1.0 - AMBIENT) * dot(normal, LIGHT).max(0.0)
    }

    /// Returns the unit normal towards the camera, or `None` if the neighbours do not span a plane.
    fn normal(&self, u: usize, v: usize, centre: [f32; 3]) -> Option<[f32; 3]> {
        let mut fit = TangentFit::default();
        for row in v.saturating_sub(REACH)..(v + REACH + 1).min(self.height) {
            for column in u.saturating_sub(REACH)..(u + REACH + 1).min(self.width) {
                let Some(point) = self.points_m[row * self.width + column] else { continue };
                let offset = subtract(point, centre);
                if offset[2].abs() <= MAX_SLOPE * offset[0].hypot(offset[1]) {
                    fit.add([column as f32 - u as f32, row as f32 - v as f32], offset);
                }
            }
        }
        let normal = unit(fit.normal()?)?;
        Some(if dot(normal, centre) > 0.0 { normal.map(|c| -c) } else { normal })
    }
}

/// Least-squares fit of offset ≈ a·du + b·dv. a and b are tangents of the surface, a × b is its normal.
#[derive(Default)]
struct TangentFit {
    uu: f32,
    uv: f32,
    vv: f32,
    u_offset: [f32; 3],
    v_offset: [f32; 3],
}

impl TangentFit {
    fn add(&mut self, [du, dv]: [f32; 2], offset: [f32; 3]) {
        self.uu += du * du;
        self.uv += du * dv;
        self.vv += dv * dv;
        for axis in 0..3 {
            self.u_offset[axis] += du * offset[axis];
            self.v_offset[axis] += dv * offset[axis];
        }
    }

    /// Returns a normal of arbitrary length. The determinant of the normal equations is positive, so it keeps the
    /// direction.
    fn normal(&self) -> Option<[f32; 3]> {
        let determinant = self.uu * self.vv - self.uv * self.uv;
        if determinant < 0.5 {
            return None;
        }
        let combine = |p: f32, a: [f32; 3], q: f32, b: [f32; 3]| {
            std::array::from_fn(|axis| (p * a[axis] - q * b[axis]) / determinant)
        };
        let along_u = combine(self.vv, self.u_offset, self.uv, self.v_offset);
        let along_v = combine(self.uu, self.v_offset, self.uv, self.u_offset);
        Some(cross(along_u, along_v))
    }
}

fn subtract(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f32; 3]) -> Option<[f32; 3]> {
    let length = dot(a, a).sqrt();
    (length > 0.0 && length.is_finite()).then(|| a.map(|c| c / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane through (0, 0, 0.5 m) with the given slopes of z along x and y, seen with 1 mm pixels.
    fn plane(slope_x: f32, slope_y: f32) -> PointMap {
        let point = |i: usize| {
            let [x, y] = [(i % 9) as f32 * 1e-3 - 4e-3, (i / 9) as f32 * 1e-3 - 4e-3];
            Some([x, y, 0.5 + slope_x * x + slope_y * y])
        };
        PointMap { width: 9, height: 9, points_m: (0..81).map(point).collect() }
    }

    #[test]
    fn normals_of_planes_are_exact_everywhere() {
        for (slope_x, slope_y) in [(0.0, 0.0), (0.5, -0.25), (-1.5, 1.0)] {
            let map = plane(slope_x, slope_y);
            let expected = unit([slope_x, slope_y, -1.0]).unwrap();
            for (i, point) in map.points_m.iter().enumerate() {
                let normal = map.normal(i % 9, i / 9, point.unwrap()).unwrap();
                assert!((0..3).all(|c| (normal[c] - expected[c]).abs() < 1e-3), "{normal:?} {expected:?}");
            }
        }
    }

    #[test]
    fn another_surface_behind_does_not_bend_the_normal() {
        let mut map = plane(0.0, 0.0);
        for i in (0..81).filter(|i| i % 9 > 4) {
            map.points_m[i] = map.points_m[i].map(|[x, y, z]| [x, y, z + 0.1]);
        }
        let normal = map.normal(4, 4, [0.0, 0.0, 0.5]).unwrap();
        assert!(normal[2] < -0.999, "{normal:?}");
    }

    #[test]
    fn a_single_point_and_a_line_of_points_span_no_plane() {
        let mut map = plane(0.0, 0.0);
        for i in (0..81).filter(|i| i / 9 != 4) {
            map.points_m[i] = None;
        }
        assert_eq!(map.normal(4, 4, [0.0, 0.0, 0.5]), None);
        assert!(map.brightness(4, 4, [0.0, 0.0, 0.5]) > AMBIENT);
    }
}
