//! Texts: configurations, manoeuvres, settings, and the records of a reproduction.

use crate::target::{Target, as_it_is};
use dynamics::config;
use pil::ecu::Software;
use pil::manoeuvre;
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use shared_model::Scenario;
use sim_host::reproduce::Product;

/// A configuration.
pub const CONFIGURATION: Target = Target {
    name: "configuration",
    read: read_configuration,
    repair: as_it_is,
    seeds: || {
        let scenario = config::to_toml(&Scenario::reconstruction());
        vec![
            scenario.into(),
            b"preset = \"printed\"\n[run]\nwheel_speed_rpm = 1600\n".into(),
        ]
    },
    // Each letter may be a key of its own, with an empty table.
    multiple: 1024,
    mutations: 20_000,
};

/// A manoeuvre.
pub const MANOEUVRE: Target = Target {
    name: "manoeuvre",
    read: read_manoeuvre,
    repair: as_it_is,
    seeds: manoeuvres,
    multiple: 1024,
    mutations: 20_000,
};

/// The record of a piece of the reproduction.
pub const RECORD: Target = Target {
    name: "record",
    read: |bytes| drop(serde_json::from_slice::<Product>(bytes)),
    repair: as_it_is,
    seeds: || {
        let record = r#"{"fingerprint": "0.1.0 Full\n", "title": "Figure 7 \u00e9", "figures": [["figure-07", "a caption"]],
            "judgements": [], "findings": [["heading", "sentence"]]}"#;
        vec![record.into()]
    },
    multiple: 64,
    mutations: 100_000,
};

/// Settings of the firmware, one a line.
pub const SETTINGS: Target = Target {
    name: "settings",
    read: read_settings,
    repair: as_it_is,
    seeds: || {
        let all = qemu::settings::of(&Scenario::reconstruction());
        vec![
            all.join("\n").into(),
            b"preset=printed\nrun.duration_s=1e-4".into(),
        ]
    },
    multiple: 0,
    mutations: 100_000,
};

fn read_configuration(bytes: &[u8]) {
    let Some(table) = std::str::from_utf8(bytes)
        .ok()
        .and_then(|text| text.parse().ok())
    else {
        return;
    };
    match config::over_preset(table, None) {
        Ok(scenario) => {
            let valid = config::validate(&scenario);
            config::differences(&scenario);
            if valid.is_ok() {
                let again = config::to_toml(&scenario).parse().expect("it was written");
                assert_eq!(config::over_preset(again, None).ok(), Some(scenario));
            }
        }
        Err(error) => drop(error.to_string()),
    }
}

/// As `pil` does before its first period, which comes too.
fn read_manoeuvre(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    match manoeuvre::from_text(text) {
        Ok((scenario, manoeuvre)) => {
            let software = Software::new(&ecu_scenario(&scenario, &manoeuvre));
            let vehicle = VehicleNode::new(&scenario, &manoeuvre);
            if let (Ok(_), Ok(mut vehicle)) = (software, vehicle) {
                assert!(vehicle.total_periods() > 0);
                vehicle.answer(&shared_model::exchange::Packet {
                    duty_code: 0,
                    bridge_on: true,
                    frame: None,
                });
            }
        }
        Err(error) => drop(error.to_string()),
    }
}

fn manoeuvres() -> Vec<Vec<u8>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/manoeuvres");
    let files = std::fs::read_dir(folder).expect("there are examples");
    let mut paths: Vec<_> = files
        .map(|file| file.expect("it is a file").path())
        .collect();
    paths.sort();
    let texts = paths
        .iter()
        .map(|path| std::fs::read(path).expect("it can be read"));
    texts.collect()
}

fn read_settings(bytes: &[u8]) {
    let mut scenario = Scenario::<f32>::reconstruction();
    for line in bytes.split(|&byte| byte == b'\n') {
        if let Ok(setting) = std::str::from_utf8(line) {
            let _ = scenario.apply(setting);
        }
    }
    if scenario.validate().is_ok() {
        assert!(scenario.steps() > 0 && scenario.samples_per_step() > 0);
        assert!(scenario.periods_per_tick() > 0);
    }
}
