use fringeflow_calibrate::*;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let board: fringeflow_board::Board = args[2].parse().unwrap();
    let folder = folder::CalibrationFolder::open(std::path::Path::new(&args[1])).unwrap();
    eprintln!("{} poses", folder.poses.len());
    let t = std::time::Instant::now();
    let observed = Observed::read(&folder, &board, [1.0; 2], || {}).unwrap();
    eprintln!("observed {:?}", t.elapsed());
    for p in &observed.poses { for c in &p.cameras { match c { Ok(s) => eprintln!("{} {s:?}", p.name), Err(e) => eprintln!("{}: {e}", p.name) } } }
    for v in &observed.views.views { eprintln!("{:?}", v.cameras.iter().map(|c| (c.corners.len(), c.patches.len())).collect::<Vec<_>>()); }
    let t = std::time::Instant::now();
    let a = Assessment::of(&observed);
    eprintln!("assessed {:?}", t.elapsed());
    for f in &a.findings { eprintln!("{f:?}"); }
    if let Ok(c) = &a.calibrated {
        eprintln!("{:#?}", c.adjusted.groups);
        eprintln!("alone {:?} other {:?}", c.alone_rms_px, c.other_poses);
        let l = adjustment::Layout::of(&c.adjusted.state);
        for (d, dev) in c.adjusted.state.devices.iter().enumerate() {
            eprintln!("{:?}", dev.lens);
            eprintln!("sd {:?}", (0..9).map(|k| c.adjusted.sd(l.lens(d) + k)).collect::<Vec<_>>());
            eprintln!("{}", dev.from_first);
        }
        let q = a.quality.unwrap();
        for c in &q.coverage { eprintln!("{} {:?}", c.share(), c.counts); }
        eprintln!("{:?}", q.expected);
        for p in &q.proposed { eprintln!("{} {:?}", p.words, p.expected); }
    }
}
