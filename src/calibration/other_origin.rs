//! Calibrations of other programs. In: the fields of a file that lacks some of ours. Out: what the file is, which of
//! its fields have which of our names, and what to add.

use super::file_storage::{Fields, Node};

/// Fields of a projector, which calibrations of cameras lack.
const PROJECTOR: &str = "Kp Dp sizep Rp Tp of the projector";

/// Words in the name or the value of a field that state a camera model other than Brown's.
const OTHER_MODELS: [&str; 8] =
    ["fisheye", "equidistant", "kannala", "omni", "eucm", "double_sphere", "scaramuzza", "ds"];

/// A kind of file, known by some of its fields.
struct Origin {
    /// All of these fields are there.
    fields: &'static [&'static str],
    /// What the file is.
    kind: &'static str,
    /// Which fields have which of our names.
    names: &'static str,
    /// What the file lacks.
    lacks: &'static str,
}

#[rustfmt::skip]
const ORIGINS: [Origin; 6] = [
    Origin {
        fields: &["cam0"],
        kind: "a camera chain of Kalibr",
        names: "cam0 is camera 1 and cam1 camera 2: intrinsics [fu, fv, pu, pv] are K, distortion_coeffs are D, \
                resolution is size, and T_cn_cnm1 of cam1 holds R2 and T2 in metres",
        lacks: PROJECTOR,
    },
    Origin {
        fields: &["camera_matrix", "distortion_coefficients"],
        kind: "the calibration of one camera, as ROS (camera_info) or an example of OpenCV writes it",
        names: "camera_matrix is K, distortion_coefficients is D, image_width and image_height are size",
        lacks: "the other camera, R2 T2, and Kp Dp sizep Rp Tp of the projector",
    },
    Origin {
        fields: &["M1", "M2"],
        kind: "the file of a stereo camera, as an example of OpenCV writes it",
        names: "M1 is K1 and M2 is K2; R and T of extrinsics.yml are R2 and T2 (the R2 there rectifies images)",
        lacks: "size1 size2, and Kp Dp sizep Rp Tp of the projector",
    },
    Origin {
        fields: &["R1", "P1", "Q"],
        kind: "the file of a stereo camera, as an example of OpenCV writes it",
        names: "R and T are R2 and T2; its own R1 and R2 rectify images and are not used",
        lacks: "K1 D1 size1 K2 D2 size2, and Kp Dp sizep Rp Tp of the projector",
    },
    Origin {
        fields: &["cam_K", "proj_K"],
        kind: "the calibration of one camera and a projector",
        names: "cam_K is K1, cam_kc D1, proj_K Kp, proj_kc Dp, R is Rp and T is Tp",
        lacks: "size1 sizep, and K2 D2 size2 R2 T2 of the other camera",
    },
    Origin {
        fields: &["CameraParameters1", "CameraParameters2"],
        kind: "a stereo calibration of MATLAB",
        names: "IntrinsicMatrix, transposed, is K; RadialDistortion (k1 k2 k3) and TangentialDistortion (p1 p2) are \
                D = [k1 k2 p1 p2 k3]; ImageSize is size, height first; RotationOfCamera2, transposed, is R2, and \
                TranslationOfCamera2 is T2",
        lacks: PROJECTOR,
    },
];

/// What a person is told about a file without some of our fields. Begins with a separator.
pub(super) fn hint(fields: &Fields) -> String {
    let known = ORIGINS.iter().find(|origin| origin.fields.iter().all(|name| fields.contains_key(*name)));
    if let Some(Origin { kind, names, lacks, .. }) = known {
        return format!(
            "; this is {kind}: {names}; it lacks {lacks}: calibrate these too, and write all into one file"
        );
    }
    if ["K1", "K2", "R2", "T2"].iter().all(|name| fields.contains_key(*name)) && !fields.contains_key("Kp") {
        return format!(
            "; this file holds both cameras and lacks {PROJECTOR}: `fringeflow calibrate --refine SCENE --from FILE` finds \
             the projector"
        );
    }
    let holds_ours = |node: &Node| ["K1", "D1", "size1"].iter().any(|name| node.field(name).is_some());
    match fields.iter().find(|(_, node)| holds_ours(node)) {
        Some((name, _)) => format!("; its fields lie inside {name}: write them at the top level"),
        None if fields.is_empty() => "; this file has no fields".to_owned(),
        None => format!("; this file has {}", listed(fields)),
    }
}

/// A camera model that the file states and that is not Brown's, in a field of its own or of a camera.
pub(super) fn other_model(fields: &Fields) -> Option<String> {
    fields.iter().find_map(|(name, node)| match node {
        Node::Text(text) if is_model(name) && is_other(text) => Some(format!("{name}: {text}")),
        Node::Number(value) if is_other(name) && *value != 0.0 => Some(name.clone()),
        Node::Number(_) if name.starts_with("xi") => Some(format!("with {name} (omnidirectional)")),
        Node::Map(inner) => other_model(inner),
        _ => None,
    })
}

fn is_model(name: &str) -> bool {
    name.to_lowercase().contains("model") || name.to_lowercase().contains("type")
}

fn is_other(text: &str) -> bool {
    let text = text.to_lowercase();
    OTHER_MODELS.iter().any(|model| text.contains(model))
}

/// Most names that are listed.
const MOST_NAMES: usize = 16;

fn listed(fields: &Fields) -> String {
    let names: Vec<&str> = fields.keys().map(String::as_str).take(MOST_NAMES).collect();
    let more = if fields.len() > MOST_NAMES { " …" } else { "" };
    format!("{}{more}", names.join(" "))
}
