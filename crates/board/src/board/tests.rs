use super::*;

const ALL: [&str; 6] = [
    "chessboard:9x6:square=25",
    "charuco:14x10:square=12:marker=9:dictionary=4x4_250",
    "charuco:7x5:square=30.5:marker=22:dictionary=5x5_100",
    "circles:9x7:spacing=20:diameter=12",
    "asymmetric-circles:4x11:spacing=20:diameter=15",
    "aprilgrid:6x6:tag=20:gap=6",
];

fn board(text: &str) -> Board {
    text.parse().unwrap()
}

#[test]
fn a_description_is_written_as_it_was_read() {
    for text in ALL {
        assert_eq!(board(text).to_string(), text);
    }
    assert_eq!(
        board("charuco:5x5:square=10mm:marker=8:dictionary=DICT_4X4_50").to_string(),
        "charuco:5x5:square=10:marker=8:dictionary=4x4_50"
    );
}

#[test]
fn wrong_descriptions_name_field_value_and_remedy() {
    for (text, parts) in [
        ("chess:9x6:square=25", &["\"chess\"", "chessboard, charuco"][..]),
        ("chessboard", &["size \"\"", "chessboard:9x6:square=25"]),
        ("chessboard:9x2:square=25", &["9x2", "inner corners", "3 to 100"]),
        ("chessboard:9x6", &["field square is missing"]),
        ("chessboard:9x6:squares=25", &["\"squares\"", "square, as in"]),
        ("chessboard:9x6:square=25:square=25", &["stands twice"]),
        ("chessboard:9x6:square=nan", &["field square", "\"nan\"", "millimetres"]),
        ("charuco:5x5:square=10:marker=10:dictionary=4x4_50", &["field marker is 10 mm", "less than 10 mm"]),
        ("charuco:5x5:square=10:marker=8:dictionary=4x4_51", &["\"4x4_51\"", "4x4_50"]),
        ("charuco:14x10:square=10:marker=8:dictionary=4x4_50", &["has 50 markers", "needs 70"]),
        ("circles:5x5:spacing=10:diameter=10", &["field diameter is 10 mm", "touch"]),
        ("aprilgrid:6x6:tag=20:gap=6:family=99h1", &["\"99h1\"", "36h11"]),
    ] {
        let error = text.parse::<Board>().unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{text}: {error}");
    }
}

#[test]
fn features_are_where_the_brightness_says() {
    for text in ALL {
        let board = board(text);
        let e = 0.01;
        for [x, y, _] in board.features() {
            let around = [(e, e), (-e, e), (-e, -e), (e, -e)].map(|(dx, dy)| board.brightness(x + dx, y + dy));
            match board.circle_radius_mm() {
                None => {
                    let is_saddle = around[0] == around[2] && around[1] == around[3] && around[0] != around[1];
                    assert!(is_saddle, "{text} at {x}, {y}: {around:?}");
                }
                Some(radius) => {
                    let rim = |r: f64| {
                        [(r, 0.0), (-r, 0.0), (0.0, r), (0.0, -r)].map(|(a, b)| board.brightness(x + a, y + b))
                    };
                    assert_eq!((rim(radius - e), rim(radius + e)), ([0.0; 4], [1.0; 4]), "{text} at {x}, {y}");
                }
            }
        }
    }
}

#[test]
fn a_pattern_that_can_be_turned_says_so() {
    for text in ALL.into_iter().chain(["chessboard:8x6:square=9", "chessboard:8x8:square=9", "chessboard:7x7:square=9"])
    {
        let board = board(text);
        let [w, h] = board.size_mm();
        let same = |turn: fn(f64, f64) -> (f64, f64)| {
            (1..4000).all(|k| {
                let (x, y) = (w * (0.75487767 * f64::from(k) % 1.0 - 0.5), h * (0.56984029 * f64::from(k) % 1.0 - 0.5));
                let (a, b) = turn(x, y);
                board.brightness(x, y) == board.brightness(a, b)
            })
        };
        let turns = if same(|x, y| (-y, x)) && w == h {
            4
        } else if same(|x, y| (-x, -y)) {
            2
        } else {
            1
        };
        assert_eq!(board.turns(), turns, "{text}");
    }
}

#[test]
fn markers_are_where_the_brightness_says() {
    for text in ALL {
        let board = board(text);
        for marker in board.markers() {
            let side = (marker.cells.len() as f64).sqrt();
            for (k, black) in marker.cells.iter().enumerate() {
                let at = |corner: f64, k: f64| corner + (k + 0.5) / side * marker.side_mm;
                let (x, y) =
                    (at(marker.corner_mm[0], k as f64 % side), at(marker.corner_mm[1], (k as f64 / side).floor()));
                assert_eq!(board.brightness(x, y) == 0.0, *black, "{text} marker {} cell {k}", marker.id);
            }
        }
    }
}

#[test]
fn a_file_describes_the_same_board() {
    let file = std::env::temp_dir().join(format!("fringeflow-board-{}.toml", std::process::id()));
    let text =
        "[board]\nkind = \"charuco\"\nsize = \"14x10\"\nsquare_mm = 12\nmarker_mm = 9.0\ndictionary = \"4x4_250\"\n";
    std::fs::write(&file, text).unwrap();
    assert_eq!(Board::read(&file.to_string_lossy()).unwrap(), board(ALL[1]));
    std::fs::write(&file, text.replace("marker_mm", "marker_cm")).unwrap();
    let error = Board::read(&file.to_string_lossy()).unwrap_err().to_string();
    assert!(error.contains(".toml") && error.contains("marker_cm"), "{error}");
    std::fs::remove_file(&file).unwrap();
}
