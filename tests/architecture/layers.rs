//! The direction of dependencies, as data. A change of the architecture is a change of these tables.

/// A top-level module of the library and what else of the library it may name: modules, or items of modules. Lower
/// layers first: a module names only what stands above it here. Unit tests are free to name anything.
pub(crate) const MODULES: &[(&str, &[&str])] = &[
    ("atomic_file", &[]),
    ("png_encoding", &[]),
    ("simd", &[]),
    ("geometry", &[]),
    ("grey", &[]),
    ("health", &[]),
    ("phase", &["grey", "simd", "geometry::FringePattern"]),
    ("message", &["grey::PixelFormat", "phase::MAX_IMAGES"]),
    ("pixels", &["grey::PixelFormat", "geometry::Readout"]),
    ("transport", &["message"]),
    ("synchronization", &["phase::MIN_STEPS", "phase::MAX_STEPS", "message"]),
    ("calibration", &["geometry", "atomic_file"]),
    ("dataset", &["grey", "geometry", "phase", "calibration", "png_encoding", "atomic_file"]),
    ("rig_report", &["geometry"]),
    ("correspondence", &["geometry", "simd", "phase", "atomic_file"]),
    ("cloud", &["geometry", "simd", "phase", "correspondence", "calibration::Unit", "atomic_file"]),
    ("registration", &["geometry", "simd", "cloud::Cloud"]),
    ("prior", &["geometry", "phase", "correspondence::KnownDrift"]),
    ("fusion", &["geometry", "registration", "prior", "correspondence::KnownDrift", "cloud", "atomic_file"]),
    ("evaluation", &["grey::GreyLevels", "geometry", "phase", "dataset", "correspondence", "cloud"]),
    ("simulation", &["grey", "geometry", "phase::GrayCode", "calibration", "dataset", "evaluation", "atomic_file"]),
    ("worker", &["grey::GreyLevels", "geometry", "phase", "prior", "correspondence", "cloud"]),
    ("telemetry", &["health", "message", "correspondence::Outcome"]),
    (
        "wire",
        &["geometry", "prior", "health", "message", "phase", "correspondence", "fusion", "registration", "worker"],
    ),
    (
        "reconstruction",
        &["grey::GreyLevels", "geometry", "phase", "prior", "fusion", "correspondence", "cloud", "worker"],
    ),
    (
        "config",
        &[
            "grey::PixelFormat",
            "health",
            "pixels::SourceFormat",
            "geometry",
            "phase",
            "calibration",
            "dataset",
            "correspondence",
            "fusion",
            "simulation",
            "reconstruction",
        ],
    ),
    (
        "recording",
        &[
            "health",
            "message",
            "geometry",
            "phase",
            "calibration",
            "dataset",
            "correspondence",
            "cloud",
            "prior",
            "fusion",
            "wire",
            "reconstruction",
            "config",
        ],
    ),
    ("preview", &["phase", "correspondence", "cloud", "evaluation", "png_encoding", "atomic_file"]),
];

/// Crates and parts of the standard library that only some places may name: top-level modules of the library, or
/// folders under `services/`. What touches the outside world stays at its border, so that the same algorithm runs live,
/// in replay and in a test, and gives the same bytes.
pub(crate) const RESTRICTED: &[(&str, &[&str])] = &[
    ("iceoryx2", &["transport", "message"]),
    ("mcap", &["recording"]),
    ("v4l", &["services/capture"]),
    ("zune_jpeg", &["pixels"]),
    ("tracing", &["transport", "recording", "services/"]),
    ("log", &["transport", "recording", "services/"]),
    ("std::time", &["transport", "recording", "services/"]),
    ("core::time", &["transport", "recording", "services/"]),
];

/// Files that may hold `unsafe`: SIMD kernels, the V4L2 queue, and calls of the system that have no safe form.
pub(crate) const UNSAFE_FILES: &[&str] = &[
    "services/capture/src/ioctl.rs",
    "services/runtime/src/processors/realtime.rs",
    "src/simd/mod.rs",
    "src/simd/arrays.rs",
    "src/simd/avx512.rs",
    "src/transport/wait.rs",
];
