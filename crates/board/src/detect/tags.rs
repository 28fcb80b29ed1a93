//! Tags of an AprilGrid. The corners of the tags are crossings of edges like those of a chessboard, since small squares
//! touch them. Four corners that are joined by edges, dark inside, are a tag if its cells are in the dictionary.

use super::corners::Level;
use super::homography::{Homography, Point};
use super::{BoardImage, NotDetected, Seed};
use crate::board::{Board, Pattern, Tags};

/// Nearest corners among which an edge may end.
const NEIGHBOURS: usize = 24;
/// Offset across an edge at which dark and bright are compared, as a share of its length; a border is an eighth.
const ACROSS: f64 = 0.06;
/// Places along an edge, and least difference across it as a share of the contrast of the image.
const ALONG: [f64; 4] = [0.2, 0.4, 0.6, 0.8];
const LEAST_STEP: f64 = 0.08;
/// Fewest tags of a detection.
const FEWEST_TAGS: usize = 2;
/// Largest distance of a corner from the map of all others, as a share of a tag.
const TOLERANCE: f64 = 0.15;

/// Corners of the tags.
pub(super) fn april_grid(board: &Board, image: &BoardImage) -> Result<Vec<Seed>, NotDetected> {
    let Pattern::AprilGrid { family, .. } = board.pattern() else { return Ok(Vec::new()) };
    let best = best_tags(board, image, family);
    if best.len() >= 4 * FEWEST_TAGS {
        return Ok(best);
    }
    if best_tags(board, &image.mirrored(), family).len() >= 4 * FEWEST_TAGS {
        return Err(NotDetected::Mirrored);
    }
    for other in Tags::all().iter().filter(|other| *other != family && other.side_cells() <= 8) {
        if other.name().starts_with("apriltag") && best_tags(board, image, other).len() >= 8 * FEWEST_TAGS {
            let (found, wanted) = (other.name().to_owned(), family.name().to_owned());
            return Err(NotDetected::OtherDictionary { found, wanted });
        }
    }
    Err(NotDetected::Nothing { found: best.len() / 4, elements: "tags" })
}

/// The corners of the tags at the size of the image at which most are found.
fn best_tags(board: &Board, image: &BoardImage, family: &Tags) -> Vec<Seed> {
    let tags = Level::all(image).into_iter().map(|level| {
        let corners: Vec<Point> = level.corners.iter().map(|corner| level.full(corner.position)).collect();
        consistent(board, &tags(image, &corners, family))
    });
    tags.max_by_key(Vec::len).unwrap_or_default()
}

/// A quadrilateral whose cells are those of a tag, its corners clockwise from the tag's top left.
struct Tag {
    id: usize,
    corners: [Point; 4],
}

fn tags(image: &BoardImage, corners: &[Point], family: &Tags) -> Vec<Tag> {
    let [dark, bright] = image.range();
    let edges: Vec<Vec<usize>> =
        (0..corners.len()).map(|k| edges_from(image, corners, k, LEAST_STEP * (bright - dark))).collect();
    let mut tags = Vec::new();
    for a in 0..corners.len() {
        for &b in &edges[a] {
            for &c in edges[b].iter().filter(|&&c| c != a) {
                for &d in edges[c].iter().filter(|&&d| d != a && d != b) {
                    // Each quadrilateral is met from all its corners; the smallest number begins it.
                    if edges[d].contains(&a) && a < b.min(c).min(d) {
                        tags.extend(decoded(image, [a, b, c, d].map(|k| corners[k]), family));
                    }
                }
            }
        }
    }
    tags
}

/// Corners to which an edge leads from a corner, with dark on its right.
fn edges_from(image: &BoardImage, corners: &[Point], from: usize, least_step: f64) -> Vec<usize> {
    let distance = |k: usize| (corners[k][0] - corners[from][0]).hypot(corners[k][1] - corners[from][1]);
    let mut others: Vec<usize> = (0..corners.len()).filter(|&k| k != from && distance(k) > 4.0).collect();
    others.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
    others.truncate(NEIGHBOURS);
    others.retain(|&to| {
        let d = [corners[to][0] - corners[from][0], corners[to][1] - corners[from][1]];
        let across = ACROSS.max(1.2 / distance(to));
        ALONG.iter().all(|share| {
            let at = |side: f64| {
                let [x, y] = corners[from];
                image.level([x + share * d[0] - side * across * d[1], y + share * d[1] + side * across * d[0]])
            };
            matches!((at(1.0), at(-1.0)), (Some(right), Some(left)) if left - right > least_step)
        })
    });
    others
}

/// Reads the cells of a quadrilateral, and looks them up in the dictionary in all four orientations.
fn decoded(image: &BoardImage, corners: [Point; 4], family: &Tags) -> Option<Tag> {
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let pairs: Vec<(Point, Point)> = unit.into_iter().zip(corners).collect();
    let map = Homography::fit(&pairs)?;
    let side = family.side_cells();
    let cell = |k: usize| {
        let at = |k: usize, offset: f64| (k as f64 + 0.5 + offset) / side as f64;
        let offsets = [(0.0, 0.0), (-0.2, -0.2), (0.2, -0.2), (-0.2, 0.2), (0.2, 0.2)];
        let levels = offsets.map(|(dx, dy)| image.level(map.image([at(k % side, dx), at(k / side, dy)])));
        levels.into_iter().try_fold(0.0, |sum, level| Some(sum + level? / 5.0))
    };
    let levels: Vec<f64> = (0..side * side).map(cell).collect::<Option<_>>()?;
    let (least, most) = levels.iter().fold((f64::MAX, f64::MIN), |(least, most), l| (least.min(*l), most.max(*l)));
    let threshold = (least + most) / 2.0;
    let is_border = |k: usize| [k % side, k / side].iter().any(|c| *c == 0 || *c == side - 1);
    if (0..side * side).any(|k| is_border(k) && levels[k] > threshold) {
        return None;
    }
    let bits = side - 2;
    let is_black = |k: usize| levels[(k / bits + 1) * side + k % bits + 1] < threshold;
    let mut code: Vec<bool> = (0..bits * bits).map(is_black).collect();
    for turn in 0..4 {
        if let Some(id) = family.id_of(&code) {
            return Some(Tag { id, corners: [0, 1, 2, 3].map(|k| corners[(k + turn) % 4]) });
        }
        // A quarter turn anticlockwise, as if the next corner began the tag.
        code = (0..bits * bits).map(|k| code[(k % bits) * bits + bits - 1 - k / bits]).collect();
    }
    None
}

/// Corners of the tags that lie on one board. Tags of other boards, and wrong ones, are left out. Programs draw tags in
/// different orientations; the one in which the tags lie on a board counts.
fn consistent(board: &Board, tags: &[Tag]) -> Vec<Seed> {
    let features = board.features();
    let Pattern::AprilGrid { tag_mm, .. } = *board.pattern() else { return Vec::new() };
    let tags: Vec<&Tag> = tags.iter().filter(|tag| 4 * tag.id + 3 < features.len()).collect();
    let seeds_of = |tag: &Tag, turn: usize| {
        [0, 1, 2, 3].map(|k| Seed { feature: 4 * tag.id + (k + turn) % 4, at: tag.corners[k] })
    };
    let pair = |seed: &Seed| ([features[seed.feature][0], features[seed.feature][1]], seed.at);
    let mut best = Vec::new();
    for turn in 0..4 {
        for (i, first) in tags.iter().enumerate() {
            // Two tags determine the map well enough to tell the others.
            for second in tags.iter().skip(i + 1).take(6).filter(|second| second.id != first.id) {
                let pairs: Vec<_> =
                    [first, second].iter().flat_map(|tag| seeds_of(tag, turn)).map(|s| pair(&s)).collect();
                let Some(map) = Homography::fit(&pairs) else { continue };
                let mut seen = vec![false; features.len() / 4];
                let fits = |tag: &&&Tag| {
                    seeds_of(tag, turn).iter().all(|seed| {
                        let (board, at) = pair(seed);
                        let [x, y] = map.board(at);
                        (x - board[0]).hypot(y - board[1]) < TOLERANCE * tag_mm
                    }) && !std::mem::replace(&mut seen[tag.id], true)
                };
                let found: Vec<Seed> = tags.iter().filter(fits).flat_map(|tag| seeds_of(tag, turn)).collect();
                if found.len() > best.len() {
                    best = found;
                }
            }
        }
    }
    best.sort_by_key(|seed| seed.feature);
    best
}
