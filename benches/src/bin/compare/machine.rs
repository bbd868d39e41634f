//! Where the run took place.

use std::process::Command;

/// One line for each fact.
pub fn describe(pinned: bool, peers: &[String]) -> Vec<String> {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let cpuinfo = read("/proc/cpuinfo");
    let field = |name: &str| {
        let line = cpuinfo.lines().find(|line| line.starts_with(name)).unwrap_or_default();
        line.split_once(':').map_or("?", |(_, value)| value.trim()).to_owned()
    };
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let total = cpuinfo.lines().filter(|line| line.starts_with("processor")).count().max(cores);
    let flags = field("flags");
    let vectors: Vec<_> =
        ["avx2", "fma", "avx512f"].into_iter().filter(|f| flags.split(' ').any(|g| g == *f)).collect();
    let load = read("/proc/loadavg");
    let load = load.split(' ').next().unwrap_or("?");
    let rustc = Command::new("rustc").arg("--version").output().ok();
    let rustc = rustc.and_then(|o| String::from_utf8(o.stdout).ok()).unwrap_or_default();
    let mut lines = vec![
        format!(
            "{} (family {}, model {}), {total} cores, {}",
            field("model name"),
            field("cpu family"),
            field("model"),
            vectors.join(", ")
        ),
        format!(
            "load average at the start {load}; this process is {}",
            if pinned { "pinned to one core" } else { "not pinned" }
        ),
        format!("{}, plain {} build: no target-cpu", rustc.trim(), std::env::consts::ARCH),
    ];
    lines.extend_from_slice(peers);
    lines.push(if cfg!(feature = "diffsol") {
        "diffsol 0.18".into()
    } else {
        "without diffsol: compiled without the feature `diffsol`".into()
    });
    lines
}
