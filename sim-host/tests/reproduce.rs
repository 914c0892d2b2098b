//! The reproduction: complete, kept, resumed, and the same whatever the number of threads.

use shared_model::Scenario;
use sim_host::paper::Reproduced;
use sim_host::reproduce::{Options, Progress, Quality, reproduce};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

fn options() -> Options {
    Options {
        quality: Quality::Quick,
        scenarios: vec![("reconstruction".into(), Scenario::reconstruction())],
    }
}

/// Every file below a folder with its bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for place in [folder.to_path_buf(), folder.join("figures")] {
        for entry in fs::read_dir(place).expect("the folder is there").flatten() {
            if entry.path().is_file() {
                let name = entry.file_name().to_string_lossy().into_owned();
                files.insert(name, fs::read(entry.path()).expect("it can be read"));
            }
        }
    }
    files
}

#[test]
fn stopped_resumed_and_made_at_once_give_the_same_files() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let (stopped, whole) = (folder.path().join("stopped"), folder.path().join("whole"));

    // Stop in the middle of the third piece.
    let stop = AtomicBool::new(false);
    let piece = AtomicUsize::new(0);
    let summary = reproduce(&stopped, &options(), &stop, &|progress| match progress {
        Progress::Begins { number, .. } => piece.store(number, Ordering::Relaxed),
        Progress::Point if piece.load(Ordering::Relaxed) == 3 => {
            stop.store(true, Ordering::Relaxed)
        }
        Progress::Point => {}
    })
    .expect("it can be made");
    assert!(!summary.complete);
    assert_eq!(
        summary.judgements.len(),
        4,
        "the sweep over the speed is done, with C1 to C4"
    );
    assert!(stopped.join("index.html").exists());

    // Continue to the end of the fourth part: the first two are kept.
    let kept = Mutex::new(Vec::new());
    let go_on = |folder: &Path| {
        let stop = AtomicBool::new(false);
        reproduce(folder, &options(), &stop, &|progress| match progress {
            Progress::Begins {
                kept: true, number, ..
            } => {
                kept.lock()
                    .expect("no thread panics while it is locked")
                    .push(number);
            }
            Progress::Begins { number: 5, .. } => stop.store(true, Ordering::Relaxed),
            _ => {}
        })
        .expect("it can be made")
    };
    assert_eq!(go_on(&stopped).judgements.len(), 8);
    assert_eq!(
        *kept.lock().expect("no thread panics while it is locked"),
        [1, 2]
    );

    // At once, on one thread.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool can be made");
    assert_eq!(pool.install(|| go_on(&whole)).judgements.len(), 8);
    let (a, b) = (files(&stopped), files(&whole));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(b[name] == *bytes, "{name} differs");
    }
    let text = String::from_utf8_lossy(&a["figure-07-reconstruction.csv"]).into_owned();
    assert!(text.starts_with("wheel_speed_rpm,yaw_rate_maximum_rad_per_s"));
    assert!(!text.contains("NaN"));

    // A digit was changed in the data of the second part and in the record of the third: both are
    // computed again.
    kept.lock()
        .expect("no thread panics while it is locked")
        .clear();
    for name in ["figure-07-reconstruction.csv", "square-reconstruction.json"] {
        let mut bytes = a[name].clone();
        let digit = bytes.iter().rposition(u8::is_ascii_digit);
        bytes[digit.expect("there are numbers")] ^= 1;
        fs::write(stopped.join("figures").join(name), bytes).expect("it can be written");
    }
    go_on(&stopped);
    assert_eq!(
        *kept.lock().expect("no thread panics while it is locked"),
        [1, 4]
    );
    assert!(files(&stopped) == a);
}

#[test]
fn the_claims_that_hold_are_found_and_a_tame_vehicle_has_none() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let verdict = |scenario: Scenario<f64>, name: &str, claim: &str| {
        let options = Options {
            quality: Quality::Quick,
            scenarios: vec![(name.into(), scenario)],
        };
        // Claims on amplitudes are in the third and fourth piece.
        let stop = AtomicBool::new(false);
        let summary = reproduce(&folder.path().join(name), &options, &stop, &|progress| {
            if let Progress::Begins { number: 5, .. } = progress {
                stop.store(true, Ordering::Relaxed);
            }
        })
        .expect("it can be made");
        let judgement = summary.judgements.into_iter().find(|j| j.claim == claim);
        judgement.expect("the claim is judged").verdict
    };
    let paper = Scenario::reconstruction();
    assert_eq!(verdict(paper, "paper", "C6"), Reproduced::Yes);
    // Without a motor current the steering stays in the middle, and nothing is chaotic.
    let mut tame = paper;
    tame.steering.motor_current_a = 0.0;
    tame.run.steering_angle_rad = 0.0;
    tame.run.sideslip_rad = 0.0;
    assert_eq!(verdict(tame, "tame", "C2"), Reproduced::No);
    assert_eq!(verdict(tame, "tame", "C8"), Reproduced::No);
}
