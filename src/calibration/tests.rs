use super::*;
use crate::geometry::{Camera, Distortion, MeasurementVolume, Point3, Pose, Vector3};

/// A rig whose cameras and projector are toed in on a volume 0.4 m away.
fn rig() -> Rig {
    let distortion = Distortion::from_opencv(&[-0.1, 0.2, 0.001, -0.001, 0.0]);
    let camera = Camera::new([600.0, 601.0], [159.5, 127.5], distortion, [320, 256]);
    let projector = Camera::new([900.0, 900.0], [255.5, 255.5], Distortion::default(), [512, 512]);
    let beside = |x_m: f64| {
        let turn = Vector3::new(0.0, -(x_m / 0.4_f64).atan(), 0.0);
        (Pose::new(Vector3::new(x_m, 0.0, 0.0), Vector3::zeros()) * Pose::new(Vector3::zeros(), turn)).inverse()
    };
    let (cam2_from_cam1, projector_from_cam1) = (beside(0.15), beside(0.06));
    Rig { cam1: camera, cam2: camera, projector, cam2_from_cam1, projector_from_cam1 }
}

fn volume() -> MeasurementVolume {
    let corner = |side: f64| Point3::new(0.05 * side, 0.04 * side, 0.01 * side);
    MeasurementVolume::new(Pose::translation(0.0, 0.0, 0.4), corner(-1.0), corner(1.0)).unwrap()
}

fn text() -> String {
    calibration_text(&rig(), Unit::Millimetre)
}

fn parse(text: &str) -> Result<Rig, CalibrationProblem> {
    parse_calibration(text, Unit::Millimetre)
}

/// What is said about the text of a calibration.
fn refusal(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

/// Every matrix of a calibration: name, rows, columns, kind, values.
fn matrices(text: &str) -> Vec<(String, usize, usize, &'static str, Vec<String>)> {
    let fields = file_storage::parse(text).unwrap();
    let matrix = |(name, node): (String, file_storage::Node)| {
        let file_storage::Matrix { rows, cols, values } = node.matrix().unwrap();
        let kind = if name.starts_with("size") { "i" } else { "d" };
        (name, rows, cols, kind, values.iter().map(|value| format!("{value:?}")).collect())
    };
    fields.into_iter().map(matrix).collect()
}

/// The text with each matrix in another form.
fn rewritten(form: impl Fn(&str, usize, usize, &str, &[String]) -> String) -> String {
    let body: Vec<String> =
        matrices(&text()).iter().map(|(n, r, c, kind, values)| form(n, *r, *c, kind, values)).collect();
    body.join("\n")
}

#[test]
fn every_form_that_opencv_writes_is_the_same_rig() {
    let expected = parse(&text()).unwrap();
    let sequences = rewritten(|name, rows, cols, kind, values| {
        if rows == 3 && cols == 3 {
            let values = values.join(", ");
            format!("{name}: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: {kind}\n   data: [ {values} ]")
        } else {
            format!("{name}: [ {} ]", values.join(", "))
        }
    });
    let blocks = rewritten(|name, _, _, _, values| format!("{name}:\n   - {}", values.join("\n   - ")));
    let arrays = rewritten(|name, rows, cols, kind, values| {
        let sizes = if rows == 3 && cols == 3 { "3, 3".to_owned() } else { values.len().to_string() };
        let values = values.join(",\n       ");
        format!("{name}: !!opencv-nd-matrix\n   sizes: [ {sizes} ]\n   dt: {kind}\n   data: [ {values} ]")
    });
    let channels = rewritten(|name, rows, cols, kind, values| {
        let values = values.join(", ");
        format!("{name}: !!opencv-matrix\n   rows: {rows}\n   cols: 1\n   dt: \"{cols}{kind}\"\n   data: [ {values} ]")
    });
    let json = rewritten(|name, rows, cols, kind, values| {
        let values = values.join(", ");
        format!(
            "    \"{name}\": {{\n        \"type_id\": \"opencv-matrix\",\n        \"rows\": {rows},\n        \"cols\": \
             {cols},\n        \"dt\": \"{kind}\",\n        \"data\": [ {values} ]\n    }},"
        )
    });
    let xml = rewritten(|name, rows, cols, kind, values| {
        if kind == "i" {
            return format!("<{name}>\n  {}</{name}>", values.join(" "));
        }
        format!(
            "<{name} type_id=\"opencv-matrix\">\n  <rows>{rows}</rows>\n  <cols>{cols}</cols>\n  <dt>{kind}</dt>\n  \
             <data>\n    {}</data></{name}>",
            values.join(" ")
        )
    });
    for (form, text) in [
        ("sequences", format!("%YAML:1.0\n---\n{sequences}\n")),
        ("sequences in blocks", format!("%YAML:1.0\n---\n{blocks}\n")),
        ("arrays of OpenCV 5", format!("%YAML 1.2\n---\n{arrays}\n")),
        ("vectors as items", format!("%YAML:1.0\n---\n{channels}\n")),
        ("JSON", format!("{{\n{}\n}}\n", json.trim_end_matches(','))),
        (
            "XML",
            format!("<?xml version=\"1.0\"?>\n<opencv_storage>\n{xml}\n<note>\"by hand\"</note>\n</opencv_storage>\n"),
        ),
        ("byte order mark", format!("\u{feff}{}", text())),
        ("lines of Windows", text().replace('\n', "\r\n")),
        (
            "comment and other fields",
            text().replace("---\n", "--- # rig of May\nflag: true\nerror: 0.2\nname: a\nlist: [ a, b ]\n"),
        ),
    ] {
        assert_eq!(parse(&text).unwrap_or_else(|e| panic!("{form}: {e}\n{text}")), expected, "{form}");
    }
}

#[test]
fn a_field_of_another_kind_is_told_as_it_is() {
    let with = |field: &str, value: &str| {
        let start = text().find(&format!("{field}: !!opencv-matrix")).unwrap();
        format!("{}{field}: {value}\nx{}", &text()[..start], &text()[start..])
    };
    for (value, told) in [
        ("640", "field size1 is the number 640; expected 1×2: width, height"),
        ("wide", "field size1 is the text \"wide\""),
        ("[ 640, b ]", "field size1 is a sequence of 2 items that are not all numbers"),
        ("{ width: 640, height: 480 }", "field size1 is a map of height width"),
        ("!!opencv-matrix\n   rows: 1\n   data: [ 640, 480 ]", "field size1 is a matrix whose rows"),
        ("[ 640, 480, 3 ]", "field size1 is 3×1 with 3 values"),
    ] {
        let found = refusal(&with("size1", value));
        assert!(found.contains(told), "{value}: {found}");
    }
    let found = refusal(&with("R2", "[ 0.1, 0.2, 0.3 ]"));
    assert!(found.contains("cv::Rodrigues"), "{found}");
    let found = refusal(&with("K1", "[ 600, 0, 0, 0, 600, 0, 159.5, 127.5, 1 ]"));
    assert!(found.contains("transposed, as MATLAB stores it"), "{found}");
    let found = refusal(&with("D1", "[ -0.1, 0.2, 0.3, -0.2 ]"));
    assert!(found.contains("fisheye"), "{found}");
}

#[test]
fn calibrations_of_other_programs_are_told_with_what_they_lack() {
    let kalibr = "cam0:\n  camera_model: pinhole\n  intrinsics: [1, 1, 1, 1]\ncam1:\n  camera_model: pinhole\n";
    let nested = format!("stereo:\n{}", text().lines().skip(2).map(|line| format!("   {line}\n")).collect::<String>());
    for (text, told) in [
        (kalibr, "a camera chain of Kalibr"),
        (kalibr, "it lacks Kp Dp sizep Rp Tp of the projector"),
        ("image_width: 640\ncamera_matrix: 1\ndistortion_coefficients: 2\n", "camera_info"),
        ("M1: 1\nD1: 2\nM2: 3\nD2: 4\n", "M1 is K1 and M2 is K2"),
        ("R: 1\nT: 1\nR1: 1\nR2: 1\nP1: 1\nP2: 1\nQ: 1\n", "its own R1 and R2 rectify images"),
        ("CameraParameters1: {}\nCameraParameters2: {}\n", "a stereo calibration of MATLAB"),
        ("K1: 1\nD1: 1\n", "this file has D1 K1"),
        (&nested, "its fields lie inside stereo"),
        ("<calibration><K1>1</K1></calibration>", "begins with <calibration>"),
        ("K1: !!opencv-matrix\n   data: !!binary |\n     $base64$ZCA=\n", "base64"),
    ] {
        let found = refusal(text);
        assert!(found.contains(told), "{text}: {found}");
    }
    for model in ["distortion_model: equidistant", "fisheye_model: 1", "xi1: 1.2", "cam0: { camera_model: omni }"] {
        let found = refusal(&text().replace("---\n", &format!("---\n{model}\n")));
        assert!(found.contains("is not supported"), "{model}: {found}");
    }
}

#[test]
fn deeply_nested_files_are_refused() {
    let deep = |begin: &str, end: &str| begin.repeat(100_000) + &end.repeat(100_000);
    refusal(&format!("<opencv_storage>{}</opencv_storage>", deep("<_>", "</_>")));
    refusal(&format!("K1: {}", deep("[", "]")));
}

#[test]
fn a_mistake_is_named_if_it_explains_why_the_volume_is_not_seen() {
    assert_eq!(likely_mistake(&rig(), &volume()), None);
    // What `wrong` does to the rig, `mistake` undoes.
    for (wrong, mistake) in [
        (Mistake::AllLengths(0.05), Mistake::AllLengths(20.0)),
        (Mistake::Cam2Transposed, Mistake::Cam2Transposed),
        (Mistake::ProjectorUnit(1e3), Mistake::ProjectorUnit(1e-3)),
    ] {
        let found = likely_mistake(&wrong.corrected(&rig()), &volume()).unwrap();
        match (found.mistake, mistake) {
            (Mistake::AllLengths(found), Mistake::AllLengths(factor)) => assert!((found / factor - 1.0).abs() < 0.01),
            (found, expected) => assert_eq!(found, expected),
        }
        assert!(found.seen_share < 0.25 && found.corrected_share > 0.6, "{found}");
    }
    for mistake in Mistake::all(&rig(), None) {
        let inverse = match mistake {
            Mistake::ProjectorUnit(factor) => Mistake::ProjectorUnit(1.0 / factor),
            Mistake::Resolution(factor) => Mistake::Resolution(1.0 / factor),
            mistake => mistake,
        };
        if mistake != Mistake::ProjectorFromCam2 {
            let restored = inverse.corrected(&mistake.corrected(&rig()));
            let difference = |a: &Pose, b: &Pose| (a.to_homogeneous() - b.to_homogeneous()).amax();
            assert!(difference(&restored.cam2_from_cam1, &rig().cam2_from_cam1) < 1e-12, "{mistake:?}");
            assert!(difference(&restored.projector_from_cam1, &rig().projector_from_cam1) < 1e-12, "{mistake:?}");
            assert_eq!(restored.cam1.focal_px(), rig().cam1.focal_px(), "{mistake:?}");
        }
    }
}

#[test]
fn a_projector_in_another_unit_than_camera_2_is_told_without_a_volume() {
    let metres = Mistake::ProjectorUnit(1e-3).corrected(&rig());
    let found = refusal(&calibration_text(&metres, Unit::Millimetre));
    assert!(found.contains("field Tp") && found.contains("it must be 1000 times as long"), "{found}");
}
