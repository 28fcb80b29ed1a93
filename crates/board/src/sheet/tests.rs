use super::*;

#[test]
fn the_drawing_is_black_where_the_board_is() {
    for text in [
        "chessboard:9x6:square=20",
        "charuco:14x10:square=12:marker=9:dictionary=4x4_250",
        "circles:9x7:spacing=20:diameter=12",
        "asymmetric-circles:4x11:spacing=15:diameter=12",
        "aprilgrid:6x6:tag=20:gap=6",
    ] {
        let board: Board = text.parse().unwrap();
        let (rectangles, discs) = (black_rectangles(&board), black_discs(&board));
        let [w, h] = board.size_mm().map(|size| size + 10.0);
        for k in 1..20_000 {
            let (x, y) = (w * (0.754_877_67 * f64::from(k) % 1.0 - 0.5), h * (0.569_840_29 * f64::from(k) % 1.0 - 0.5));
            let is_in = |r: &[f64; 4]| x > r[0] && x < r[0] + r[2] && y > r[1] && y < r[1] + r[3];
            let is_black = rectangles.iter().any(is_in) || discs.iter().any(|d| (x - d[0]).hypot(y - d[1]) < d[2]);
            assert_eq!(is_black, board.brightness(x, y) == 0.0, "{text} at {x}, {y}");
        }
    }
}

#[test]
fn a_sheet_has_the_size_of_its_page_and_everything_on_it() {
    let board: Board = "charuco:14x10:square=12:marker=9:dictionary=4x4_250".parse().unwrap();
    for page in Page::ALL {
        let Ok(sheet) = Sheet::new(&board, page) else {
            assert_eq!(page.name(), "a5");
            continue;
        };
        let [w, h] = sheet.size_mm();
        assert!(
            sheet
                .rectangles
                .iter()
                .all(|r| r[0] >= 5.0 && r[1] >= 5.0 && r[0] + r[2] <= w - 5.0 && r[1] + r[3] <= h - 5.0)
        );
        assert!(sheet.lines.iter().flatten().all(|[x, y]| (0.0..=w - 1.0).contains(x) && (0.0..=h - 1.0).contains(y)));
        assert!(sheet.texts.iter().all(|t| t.at_mm[1] < h - 2.0 && t.at_mm[0] >= 5.0), "{:?}", sheet.texts);
    }
    let error = Sheet::new(&board, Page::ALL[0]).unwrap_err().to_string();
    assert!(error.contains("page a5") && error.contains("larger page"), "{error}");
}

#[test]
fn the_table_of_a_pdf_tells_where_its_objects_are() {
    let board: Board = "circles:9x7:spacing=20:diameter=12".parse().unwrap();
    let pdf = String::from_utf8(Sheet::new(&board, Page::Own).unwrap().pdf()).unwrap();
    let table = pdf.rfind("xref\n0 7\n").unwrap();
    for (k, line) in pdf[table..].lines().skip(3).take(6).enumerate() {
        let place: usize = line[..10].parse().unwrap();
        assert!(pdf[place..].starts_with(&format!("{} 0 obj", k + 1)), "object {}", k + 1);
    }
    let length: usize = pdf.split("/Length ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    let stream = pdf.split("stream\n").nth(1).unwrap();
    assert_eq!(stream.strip_suffix("end").unwrap_or(stream).len(), length);
}
