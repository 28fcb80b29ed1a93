//! The status of the instance as OpenMetrics text.
//!
//! All label sets are fixed, so most series exist from the first scrape to the last. Figures of windows are NaN before
//! the first window; those of the drift are NaN while no drift is measured. Only some windows report figures of light,
//! fringes, motion and health: such a series exists while its value is known.

use std::fmt::Error;
use std::sync::{Arc, Mutex, PoisonError};

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, MetricEncoder, NoLabelSet, text};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Registry;

use fringeflow_message::{DropReason, Incident, Stage};
use fringeflow_telemetry::health::{HealthState, Quantity};
use fringeflow_telemetry::{
    BUCKETS_NS, DriftFigures, DropKind, GaugeFigures, HealthFigures, Latencies, MotionFigures, Segment, Shares,
    TrackingFigures, WindowFigures,
};

use crate::instance_status::InstanceStatus;
use crate::services::ServiceStatus;

/// The metrics of an instance.
#[derive(Debug)]
pub(crate) struct Metrics(Registry);

#[derive(Debug)]
struct StatusCollector {
    status: Arc<Mutex<InstanceStatus>>,
    clients: Arc<std::sync::atomic::AtomicUsize>,
}

/// Names and values of the labels of a series.
type Labels<'a> = Vec<(&'static str, &'a str)>;

impl Metrics {
    pub(crate) fn new(status: Arc<Mutex<InstanceStatus>>, clients: Arc<std::sync::atomic::AtomicUsize>) -> Self {
        let mut registry = Registry::with_prefix("fringeflow");
        registry.register_collector(Box::new(StatusCollector { status, clients }));
        Self(registry)
    }

    /// Returns all metrics at this moment as OpenMetrics text.
    pub(crate) fn text(&self) -> String {
        let mut out = String::new();
        // Writing to a string cannot fail.
        let _ = text::encode(&mut out, &self.0);
        out
    }
}

impl Collector for StatusCollector {
    fn encode(&self, encoder: DescriptorEncoder<'_>) -> Result<(), Error> {
        let status = self.status.lock().unwrap_or_else(PoisonError::into_inner);
        let clients = self.clients.load(std::sync::atomic::Ordering::Relaxed);
        let mut out = MetricWriter(encoder);
        write_instance(&mut out, &status, clients)?;
        write_stages(&mut out, &status)?;
        write_latencies(&mut out, &status)?;
        write_window(&mut out, status.window.as_ref())?;
        write_tracking(&mut out, status.tracking.as_ref())?;
        write_services(&mut out, &status.service_statuses)
    }
}

fn write_instance(out: &mut MetricWriter<'_>, status: &InstanceStatus, clients: usize) -> Result<(), Error> {
    let version = vec![("version", env!("CARGO_PKG_VERSION"))];
    out.gauges("build_info", "The running version.", [(version, 1.0)])?;
    out.gauge("scanning", "1 while cameras and projector run.", f64::from(status.state.scanning))?;
    out.gauge("recording", "1 while a recording runs.", f64::from(u8::from(status.is_recording())))?;
    out.gauge("monitor_clients", "Connected dashboard pages.", clients as f64)?;
    let bytes = |mb: f64| mb * 1e6;
    let free = status.free_space;
    out.gauge("shared_memory_free_bytes", "Free bytes of shared memory.", bytes(free.shared_memory_free_mb))?;
    out.gauge("disk_free_bytes", "Free bytes of the disk that holds the recordings.", bytes(free.disk_free_mb))?;
    let seconds = |ns: Option<f64>| ns.map_or(f64::NAN, |ns| ns * 1e-9);
    let skew = &status.skew;
    let if_any = |ns: i64| (skew.pairs > 0).then_some(ns as f64);
    let skews = [("mean", skew.mean_ns()), ("least", if_any(skew.least_ns)), ("greatest", if_any(skew.greatest_ns))];
    out.gauges(
        "camera_skew_seconds",
        "Delay of the images of camera 2 behind those of camera 1, over the last second.",
        skews.map(|(statistic, ns)| (vec![("statistic", statistic)], seconds(ns))),
    )
}

fn write_stages(out: &mut MetricWriter<'_>, status: &InstanceStatus) -> Result<(), Error> {
    let counts = |stage| status.tally.stage(stage).map(|of_stage| of_stage.counts).unwrap_or_default();
    let label = |stage: Stage| vec![("stage", stage.name())];
    let each = |value: &dyn Fn(Stage) -> u64| Stage::ALL.map(|stage| (label(stage), value(stage)));
    out.counters(
        "stage_taken",
        "Items that the previous stage put out, including those lost on the way.",
        each(&|stage| counts(stage).taken),
    )?;
    out.counters("stage_passed", "Items that the stage put out.", each(&|stage| counts(stage).passed))?;
    let dropped = Stage::ALL.into_iter().flat_map(|stage| {
        let counts = counts(stage);
        DropReason::ALL.map(|reason| {
            let kind = DropKind::of(reason).name();
            (vec![("stage", stage.name()), ("reason", reason.name()), ("kind", kind)], counts.dropped(reason))
        })
    });
    let help = "Items that the stage dropped, by reason. The kind is loss, choice or unmeasurable.";
    out.counters("stage_dropped", help, dropped)?;
    let incidents = Stage::ALL.into_iter().flat_map(|stage| {
        let counts = counts(stage);
        Incident::ALL.map(|incident| {
            (vec![("stage", stage.name()), ("incident", incident.name())], counts.incidents[incident as usize])
        })
    });
    out.counters("stage_incidents", "Faults that the stage survived.", incidents)?;
    let depth = |value: &dyn Fn(Stage) -> u64| Stage::ALL.map(|stage| (label(stage), value(stage) as f64));
    out.gauges(
        "stage_in_work",
        "Items that the stage has taken and not finished.",
        depth(&|stage| status.in_work(stage)),
    )?;
    out.gauges(
        "stage_waiting",
        "Items that the previous stage put out and this stage has not taken.",
        depth(&|stage| status.waiting(stage)),
    )
}

fn write_latencies(out: &mut MetricWriter<'_>, status: &InstanceStatus) -> Result<(), Error> {
    let none = Latencies::default();
    let of_stage = |stage| status.tally.stage(stage).map_or(&none, |of_stage| &of_stage.latencies);
    out.histograms(
        "stage_latency_seconds",
        "Time from taking an item to putting it out.",
        Stage::ALL.map(|stage| (vec![("stage", stage.name())], of_stage(stage))),
    )?;
    out.histograms(
        "segment_seconds",
        "Parts of the time from exposure to cloud. They add up to the total.",
        Segment::ALL.map(|segment| (vec![("segment", segment.name())], status.tally.segment(segment))),
    )?;
    out.histogram(
        "exposure_to_cloud_seconds",
        "Time from the start of the last exposure of a window to its published cloud.",
        status.tally.total(),
    )
}

fn write_window(out: &mut MetricWriter<'_>, window: Option<&WindowFigures>) -> Result<(), Error> {
    let figure = |of: fn(&WindowFigures) -> f64| window.map_or(f64::NAN, of);
    out.gauge("delta_sd_radians", "Standard deviation sd of delta.", figure(|w| w.sd_rad))?;
    out.gauge("delta_noise_sd_radians", "Part of sd that is noise.", figure(|w| w.noise_sd_rad))?;
    out.gauge("delta_threshold_radians", "Threshold thr of delta about its mean.", figure(|w| w.thr_rad))?;
    out.gauge("delta_median_radians", "Median of delta over the chosen candidates.", figure(|w| w.delta_median_rad))?;
    out.gauge("segment_periods", "Mean number n of fringe periods on an epipolar segment.", figure(|w| w.n))?;
    out.gauge("expected_false_candidates", "Expected false candidates for each true one, efc.", figure(|w| w.efc))?;
    let puc_predicted = figure(|w| w.puc_predicted / 100.0);
    out.gauge("expected_unique_share", "Expected share of unique correspondences, puc, from efc.", puc_predicted)?;
    let puc = figure(|w| w.puc.map_or(f64::NAN, |percent| percent / 100.0));
    out.gauge("unique_share", "Share of the points whose pixel had a single candidate, puc.", puc)?;
    write_drift(out, window.and_then(|w| w.drift.as_ref()))?;
    out.gauge("cloud_points", "Pixels of the last window with a correspondence.", figure(|w| w.points as f64))?;
    let percent = window.map_or(Shares::NOT_A_NUMBER, |w| w.outcomes);
    let shares = percent.with_names().map(|(outcome, percent)| (vec![("outcome", outcome)], percent / 100.0));
    out.gauges("pixel_share", "Share of the pixels of camera 1 with a valid phase, by outcome.", shares)?;
    let cameras =
        |values: [f64; 2]| ["1", "2"].into_iter().zip(values).map(|(camera, value)| (vec![("camera", camera)], value));
    let residuals = window.map_or([f64::NAN; 2], |w| w.residual.map(|share| share.map_or(f64::NAN, f64::from)));
    out.gauges("fit_residual_ratio", "Median of fit residual by modulation.", cameras(residuals))?;
    let valid = window.map_or([f64::NAN; 2], |w| w.valid.map(|percent| percent / 100.0));
    out.gauges("valid_pixel_share", "Share of the pixels with a valid phase.", cameras(valid))?;
    write_light(out, window)?;
    write_health(out, window.and_then(|window| window.health.as_ref()))
}

fn write_drift(out: &mut MetricWriter<'_>, drift: Option<&DriftFigures>) -> Result<(), Error> {
    let figure = |of: fn(&DriftFigures) -> f64| drift.map_or(f64::NAN, of);
    out.gauge("drift_rms_radians", "Drift of the calibration over the measurement volume.", figure(|d| d.rms_rad))?;
    out.gauge("drift_error_pixels", "Calibration error that explains the drift.", figure(|d| d.error_px))?;
    out.gauge("drift_pixel_share", "Share of the pixels that agree with the drift.", figure(|d| d.agreeing / 100.0))?;
    out.gauge(
        "delta_residual_sd_radians",
        "Standard deviation of delta about the drift.",
        figure(|d| d.residual_sd_rad),
    )
}

/// Writes figures of light, fringes and motion. An unknown figure has no series, since no number could stand for it.
fn write_light(out: &mut MetricWriter<'_>, window: Option<&WindowFigures>) -> Result<(), Error> {
    let known = |of: &dyn Fn(usize) -> Option<f64>| -> Vec<(Labels<'static>, f64)> {
        let camera = |(name, camera): (&'static str, usize)| Some((vec![("camera", name)], of(camera)?));
        [("1", 0), ("2", 1)].into_iter().filter_map(camera).collect()
    };
    let camera = |number: usize| window.map(|window| &window.cameras[number]);
    let moved = |number: usize, of: fn(&MotionFigures) -> f64| camera(number)?.motion.as_ref().map(of);
    let share = |percent: Option<f64>| percent.map(|percent| percent / 100.0);
    out.gauges(
        "saturated_pixel_share",
        "Share of the lit pixels with saturated samples.",
        known(&|number| share(camera(number)?.saturated)),
    )?;
    out.gauges(
        "dim_pixel_share",
        "Share of the lit pixels that are barely lit.",
        known(&|number| share(camera(number)?.dim)),
    )?;
    let harmonics = ["second", "third"].into_iter().flat_map(|order| {
        [("1", 0), ("2", 1)].into_iter().filter_map(move |(name, number)| {
            let camera = camera(number)?;
            let share = if order == "second" { camera.second_harmonic } else { camera.third_harmonic };
            Some((vec![("camera", name), ("harmonic", order)], f64::from(share?)))
        })
    });
    out.gauges("fringe_harmonic_ratio", "Amplitude of a harmonic of the fringes by modulation.", harmonics)?;
    out.gauges(
        "motion_median_radians",
        "Median phase motion from image to image.",
        known(&|number| moved(number, |motion| motion.median_rad.into())),
    )?;
    out.gauges(
        "motion_fast_radians",
        "Phase motion from image to image that one pixel in twenty exceeds.",
        known(&|number| moved(number, |motion| motion.fast_rad.into())),
    )?;
    out.gauges(
        "brightness_change_share",
        "Greatest deviation of the brightness of an image from the mean.",
        known(&|number| moved(number, |motion| f64::from(motion.brightness) / 100.0)),
    )?;
    out.gauges(
        "one_surface_pixels",
        "Pixels decoded from part of their images.",
        known(&|number| moved(number, |motion| motion.one_surface_pixels as f64)),
    )?;
    out.gauges(
        "motion_lost_pixels",
        "Pixels left out because of motion.",
        known(&|number| moved(number, |motion| motion.lost_pixels as f64)),
    )?;
    out.gauges(
        "slip_steps",
        "Steps by which the pattern was ahead of the declared phase shifts. The phases are corrected.",
        known(&|number| Some(window?.slip_steps[number].into())),
    )
}

/// Writes the health: all states from the start on, levels and limits once they are known.
fn write_health(out: &mut MetricWriter<'_>, health: Option<&HealthFigures>) -> Result<(), Error> {
    let code = |state: HealthState| match state {
        HealthState::NotKnown => -1.0,
        HealthState::Ok => 0.0,
        HealthState::Warn => 1.0,
        HealthState::Bad => 2.0,
    };
    let gauge = |quantity: Quantity| health.and_then(|health| health.quantity(quantity));
    let state = |quantity: Quantity| gauge(quantity).map_or(HealthState::NotKnown, |gauge| gauge.state);
    let label = |quantity: Quantity| vec![("quantity", quantity.name()), ("unit", unit(quantity))];
    out.gauges(
        "health_state",
        "State of a quantity: 0 ok, 1 warn, 2 bad, -1 not known.",
        Quantity::ALL.map(|quantity| (vec![("quantity", quantity.name())], code(state(quantity)))),
    )?;
    let overall = health.map_or(HealthState::NotKnown, |health| health.state);
    out.gauge("health_worst_state", "The worst state of all quantities.", code(overall))?;
    let known = |of: fn(&GaugeFigures) -> Option<f64>| {
        Quantity::ALL.into_iter().filter_map(move |quantity| Some((label(quantity), of(gauge(quantity)?)?)))
    };
    out.gauges(
        "health_level",
        "Level of a quantity over the last windows, in its unit. Unknown levels have no series.",
        known(|gauge| gauge.level),
    )?;
    out.gauges("health_warn_limit", "Level beyond which a quantity is a warning.", known(|gauge| Some(gauge.warn)))?;
    out.gauges("health_bad_limit", "Level beyond which a quantity is bad.", known(|gauge| Some(gauge.bad)))
}

/// Unit of a quantity, named as Prometheus does.
fn unit(quantity: Quantity) -> &'static str {
    match quantity.unit() {
        "rad" => "radians",
        "ms" => "milliseconds",
        _ => "ratio",
    }
}

fn write_tracking(out: &mut MetricWriter<'_>, tracking: Option<&TrackingFigures>) -> Result<(), Error> {
    let figure = |of: fn(&TrackingFigures) -> f64| tracking.map_or(f64::NAN, of);
    let states = ["tracked", "lost", "no_cloud"];
    out.gauges(
        "tracking_state",
        "1 for the state of the tracking: the last cloud has a pose, has none, or no cloud came for two seconds.",
        states.map(|state| (vec![("state", state)], f64::from(u8::from(tracking.is_some_and(|t| t.state == state))))),
    )?;
    out.gauge(
        "tracking_rms_metres",
        "Root mean square of the distances of the last cloud from the model.",
        figure(|t| t.rms_mm * 1e-3),
    )?;
    out.gauge(
        "tracking_inlier_share",
        "Share of the points of the last cloud with a partner in the model.",
        figure(|t| t.inliers / 100.0),
    )?;
    out.gauge(
        "tracking_sd_metres",
        "Standard deviation of the pose of the last cloud, at the centre of the model.",
        figure(|t| t.sd_mm * 1e-3),
    )?;
    out.gauge(
        "tracking_sd_radians",
        "Standard deviation of the rotation of the pose of the last cloud.",
        figure(|t| t.sd_deg.to_radians()),
    )?;
    out.gauge("tracked_cloud_share", "Share of all clouds that have a pose.", figure(|t| t.clouds_tracked / 100.0))?;
    out.gauge("model_points", "Points of the model.", figure(|t| t.model_points as f64))?;
    out.gauge("model_clouds", "Clouds in the model.", figure(|t| t.model_clouds as f64))
}

fn write_services(out: &mut MetricWriter<'_>, services: &[ServiceStatus]) -> Result<(), Error> {
    let each = |value: fn(&ServiceStatus) -> f64| {
        services.iter().map(move |service| (vec![("service", service.name)], value(service)))
    };
    out.gauges("service_up", "1 while the service does its work.", each(|s| f64::from(u8::from(s.is_up()))))?;
    out.gauges(
        "service_memory_bytes",
        "Memory of the service in RAM, including shared memory.",
        each(|s| s.memory_bytes as f64),
    )?;
    out.counters("service_cpu_seconds", "CPU time of the service.", each(|s| s.cpu_s))?;
    let faults = services.iter().flat_map(|service| {
        let series = |(kind, faults)| (vec![("service", service.name), ("kind", kind)], faults);
        ["minor", "major"].into_iter().zip(service.page_faults).map(series)
    });
    let help = "Page faults of the service: minor ones, which map memory, and major ones, which wait for a disk.";
    out.counters("service_page_faults", help, faults)?;
    let restarts = services.iter().map(|service| (vec![("service", service.name)], u64::from(service.restarts)));
    out.counters("service_restarts", "Restarts of the service.", restarts)
}

/// Writes metrics, each with help text and its series.
struct MetricWriter<'a>(DescriptorEncoder<'a>);

impl MetricWriter<'_> {
    fn gauge(&mut self, name: &str, help: &str, value: f64) -> Result<(), Error> {
        ConstGauge::new(value).encode(self.0.encode_descriptor(name, help, None, MetricType::Gauge)?)
    }

    fn gauges<'l>(
        &mut self,
        name: &str,
        help: &str,
        series: impl IntoIterator<Item = (Labels<'l>, f64)>,
    ) -> Result<(), Error> {
        self.family(name, help, MetricType::Gauge, series, |value, encoder| ConstGauge::new(*value).encode(encoder))
    }

    fn counters<'l, N>(
        &mut self,
        name: &str,
        help: &str,
        series: impl IntoIterator<Item = (Labels<'l>, N)>,
    ) -> Result<(), Error>
    where
        N: Copy,
        ConstCounter<N>: EncodeMetric,
    {
        self.family(name, help, MetricType::Counter, series, |value, encoder| ConstCounter::new(*value).encode(encoder))
    }

    fn histograms<'l, 'h>(
        &mut self,
        name: &str,
        help: &str,
        series: impl IntoIterator<Item = (Labels<'l>, &'h Latencies)>,
    ) -> Result<(), Error> {
        self.family(name, help, MetricType::Histogram, series, |latencies, encoder| {
            encode_latencies(latencies, encoder)
        })
    }

    fn histogram(&mut self, name: &str, help: &str, latencies: &Latencies) -> Result<(), Error> {
        encode_latencies(latencies, self.0.encode_descriptor(name, help, None, MetricType::Histogram)?)
    }

    fn family<'l, V>(
        &mut self,
        name: &str,
        help: &str,
        metric_type: MetricType,
        series: impl IntoIterator<Item = (Labels<'l>, V)>,
        encode: impl Fn(&V, MetricEncoder<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut family = self.0.encode_descriptor(name, help, None, metric_type)?;
        series.into_iter().try_for_each(|(labels, value)| encode(&value, family.encode_family(&labels)?))
    }
}

fn encode_latencies(latencies: &Latencies, mut encoder: MetricEncoder<'_>) -> Result<(), Error> {
    let bounds_s = BUCKETS_NS.map(|bound_ns| bound_ns as f64 / 1e9).into_iter().chain([f64::INFINITY]);
    let buckets: Vec<(f64, u64)> = bounds_s.zip(latencies.buckets().iter().copied()).collect();
    encoder.encode_histogram::<NoLabelSet>(latencies.sum_ns() as f64 * 1e-9, latencies.count(), &buckets, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    use fringeflow_config::ScannerConfiguration;
    use fringeflow_dataset::Setup;
    use fringeflow_message::{Counts, DriftReport, Fit, GaugeReport, StageReport, WindowReport};

    const MS: u64 = 1_000_000;

    fn demo_status() -> InstanceStatus {
        let text = include_str!("../../../configs/demo.toml");
        let configuration = ScannerConfiguration::parse(text, Path::new("/configs")).unwrap();
        let setup = Setup::parse(fringeflow_lab::simulation::setup_text(&configuration).unwrap(), None).unwrap();
        InstanceStatus::new(&configuration, &setup, 0)
    }

    /// Value of a series, as text.
    fn value<'t>(text: &'t str, series: &str) -> &'t str {
        let line = text.lines().find_map(|line| line.strip_prefix(series)?.strip_prefix(' '));
        line.unwrap_or_else(|| panic!("{series} is missing"))
    }

    fn series(text: &str) -> Vec<&str> {
        let series = text.lines().filter(|line| !line.starts_with('#'));
        series.filter_map(|line| Some(line.rsplit_once(' ')?.0)).collect()
    }

    #[test]
    fn series_are_the_same_before_and_after_reports() {
        let status = Arc::new(Mutex::new(demo_status()));
        let metrics = Metrics::new(Arc::clone(&status), Arc::default());
        let before = metrics.text();
        assert_eq!(value(&before, "fringeflow_delta_sd_radians"), "NaN");
        let mut counts = Counts { taken: 9, passed: 7, ..Counts::default() };
        counts.drop_one(DropReason::Overrun);
        let (exposure_start_ns, taken_ns, passed_ns) = (MS, 2 * MS, 41 * MS);
        let stage = Stage::Cloud as u32;
        let report =
            StageReport { stage, of_item: 1, exposure_start_ns, taken_ns, passed_ns, counts, ..StageReport::default() };
        status.lock().unwrap().add_report(&report);
        let drift = DriftReport { rms_rad: 0.125, share: 0.5, is_measured: 1, ..DriftReport::default() };
        let mut report = WindowReport { delta_sd_rad: 0.25, drift, ..WindowReport::default() };
        report.cam1 = Fit { lit_pixels: 100, saturated_pixels: 25, second_harmonic_share: 0.125, ..report.cam1 };
        for fit in [&mut report.cam1, &mut report.cam2] {
            fit.third_harmonic_share = -1.0;
        }
        let known = GaugeReport { level: 0.5, warn: 0.1, bad: 0.25, since_ns: 1, state: 3, is_known: 1 };
        report.health.gauges[Quantity::SaturatedCam1 as usize] = known;
        report.health.gauges[Quantity::HarmonicsCam2 as usize] =
            GaugeReport { is_known: 0, level: 0.0, state: 0, ..known };
        status.lock().unwrap().add_window(&report);
        let after = metrics.text();
        let [before_series, after_series] = [series(&before), series(&after)];
        assert!(before_series.iter().all(|name| after_series.contains(name)));
        assert_eq!(value(&after, "fringeflow_delta_sd_radians"), "0.25");
        assert_eq!([&before, &after].map(|text| value(text, "fringeflow_drift_rms_radians")), ["NaN", "0.125"]);
        let state = |quantity: &str| format!("fringeflow_health_state{{quantity=\"{quantity}\"}}");
        assert_eq!([&before, &after].map(|text| value(text, &state("saturated_cam1"))), ["-1.0", "2.0"]);
        assert_eq!([&before, &after].map(|text| value(text, &state("harmonics_cam2"))), ["-1.0", "-1.0"]);
        assert_eq!([&before, &after].map(|text| value(text, "fringeflow_health_worst_state")), ["-1.0", "2.0"]);
        let level = "fringeflow_health_level{quantity=\"saturated_cam1\",unit=\"ratio\"}";
        assert_eq!(value(&after, level), "0.5");
        assert_eq!(value(&after, "fringeflow_saturated_pixel_share{camera=\"1\"}"), "0.25");
        assert_eq!(value(&after, "fringeflow_fringe_harmonic_ratio{camera=\"1\",harmonic=\"second\"}"), "0.125");
        let unknown = ["health_level{quantity=\"harmonics_cam2\"", "saturated_pixel_share{camera=\"2\"", "\"third\""];
        for name in unknown {
            assert!(!after.contains(name), "{name} in {after}");
        }
        assert_eq!(value(&after, "fringeflow_drift_pixel_share"), "0.5");
        assert_eq!(value(&after, "fringeflow_stage_passed_total{stage=\"cloud\"}"), "7");
        assert_eq!(
            value(&after, "fringeflow_stage_dropped_total{stage=\"cloud\",reason=\"overrun\",kind=\"loss\"}"),
            "1"
        );
        assert_eq!(value(&after, "fringeflow_stage_in_work{stage=\"cloud\"}"), "1.0");
        let bucket = |le: &str| value(&after, &format!("fringeflow_exposure_to_cloud_seconds_bucket{{le=\"{le}\"}}"));
        assert_eq!([bucket("0.03"), bucket("0.05"), bucket("+Inf")], ["0", "1", "1"]);
        assert!(after.ends_with("# EOF\n"));
    }
}
