//! A map computed on a Slurm cluster by the scripts of `examples/cluster/`: a shard near its time
//! limit, one that is killed, a node that is drained, and a plan that is not valid.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use tests::slurm::{Cluster, signal};
use tests::{root, sim_host};

/// 24 tiles, each of about half a second.
const PLAN: &str = "--dither square --speeds 64 --amplitudes 48 --transient 200 --time 2000";
const SHARDS: &str = "4";
/// Time for each step of the test.
const LIMIT: Duration = Duration::from_secs(60);

#[test]
fn the_same_bytes_after_stopped_and_killed_shards_and_a_drained_node() {
    let cluster = match Cluster::start() {
        Ok(cluster) => cluster,
        Err(reason) => {
            // Past the test harness, which would keep it.
            let _ = writeln!(std::io::stderr(), "UNTESTED: the map on Slurm: {reason}");
            return;
        }
    };
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let at = |name: &str| folder.path().join(name);
    let job = submit(&cluster, &at("map"), PLAN);
    let task = |shard: u32| format!("{job}_{shard}");

    // The signal that Slurm sends to the script before the time limit.
    cluster.wait("a tile of shard 1", LIMIT, |_| {
        tiles(&at("map/shard-1")) > 0
    });
    signal("TERM", cluster.process(1, "slurm_script"));

    // A node is drained, and its shard computed elsewhere.
    let of_task =
        |shard, format| cluster.query("squeue", &["-h", "-j", &task(shard), "-o", format]);
    cluster.wait("a tile of shard 2", LIMIT, |_| {
        tiles(&at("map/shard-2")) > 0
    });
    let node = of_task(2, "%N");
    let node_is = |state: &str| {
        let update = [
            "update",
            &format!("NodeName={node}"),
            &format!("State={state}"),
        ];
        cluster.query("scontrol", &[&update[..], &["Reason=test"]].concat());
    };
    node_is("DRAIN");
    cluster.query("scontrol", &["requeue", &task(2)]);
    cluster.wait("the drained node", LIMIT, |cluster| {
        cluster.query("sinfo", &["-h", "-n", &node, "-o", "%T"]) == "drained"
    });
    let there = cluster.query("squeue", &["-h", "-w", &node]);
    assert_eq!(there, "", "a job runs on the drained node");
    node_is("RESUME");

    // The last task has the id of the array's job.
    cluster.wait("a tile of shard 4", LIMIT, |_| {
        tiles(&at("map/shard-4")) > 0
    });
    signal("KILL", cluster.process(4, "sim-host map"));

    cluster.wait("the end of all jobs", LIMIT, |cluster| {
        cluster.query("squeue", &["-h"]).is_empty()
    });
    let log = |name: &str| fs::read_to_string(at("map").join(name)).unwrap_or_default();
    let logs = [1, 2, 3, 4].map(|shard| log(&format!("shard-{shard}.log")));
    let restarts = logs.each_ref().map(|log| log.matches("restart 1").count());
    assert_eq!(restarts, [1, 1, 0, 1], "{logs:#?}");
    assert!(logs[0].contains("status 2; it is requeued"), "{}", logs[0]);
    assert!(
        logs[3].contains("status 137; it is requeued"),
        "{}",
        logs[3]
    );

    let whole = Command::new(sim_host())
        .args(["map", "--out", "map.csv", "--parquet", "map.parquet"])
        .args(PLAN.split_whitespace())
        .current_dir(folder.path())
        .output()
        .expect("it starts");
    assert!(whole.status.success(), "{whole:?}");
    for name in ["map.csv", "map.parquet"] {
        let merged = fs::read(at("map").join(name)).unwrap_or_default();
        assert!(
            merged == fs::read(at(name)).unwrap(),
            "{name}: {}",
            log("merge.log")
        );
    }

    // A shard that fails is not requeued, and nothing is merged.
    submit(&cluster, &at("invalid"), "--time nan");
    cluster.wait("the end of all jobs", LIMIT, |cluster| {
        cluster.query("squeue", &["-h"]).is_empty()
    });
    let log = fs::read_to_string(at("invalid/shard-1.log")).unwrap();
    assert!(log.contains("NaN s") && !log.contains("requeued"), "{log}");
    assert!(!at("invalid/map.csv").exists() && !at("invalid/merge.log").exists());
}

/// Submits a map; returns the id of its array job.
fn submit(cluster: &Cluster, folder: &Path, plan: &str) -> String {
    let program = sim_host();
    let programs = program.parent().expect("it is in a folder").display();
    let mut command = cluster.command(root().join("examples/cluster/slurm-submit.sh"));
    let path = std::env::var("PATH").unwrap_or_default();
    command.env("PATH", format!("{programs}:{path}"));
    command
        .arg(SHARDS)
        .arg(folder)
        .args(plan.split_whitespace());
    let output = command.output().expect("it starts");
    let text = String::from_utf8_lossy(&output.stdout);
    let job = text
        .strip_prefix("array job ")
        .and_then(|rest| rest.split(',').next());
    job.unwrap_or_else(|| panic!("{output:?}")).to_owned()
}

fn tiles(folder: &Path) -> usize {
    let files = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = files.map(|file| file.file_name().into_string().unwrap_or_default());
    names.filter(|name| name.starts_with("tile-")).count()
}
