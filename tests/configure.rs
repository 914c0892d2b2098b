//! `sim-host firmware configure`: the configuration in the flash of the product's image.

use image::Image;
use qemu::configured::place;
use shared_model::Scenario;
use shared_model::configuration::{BLOCK_LEN, load};
use std::fs;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use tests::{image, sim_host};

const CLOCK_HZ: u32 = 25_000_000;

/// A folder with a configuration file and the image without a configuration.
struct Case {
    folder: TempDir,
}

impl Case {
    fn new(toml: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        fs::write(folder.path().join("vehicle.toml"), toml).expect("it can be written");
        fs::copy(image("ecu").path, folder.path().join("ecu")).expect("it can be copied");
        Self { folder }
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }

    /// Exit code, and standard output with standard error after it.
    fn run(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let output = Command::new(sim_host())
            .args(["firmware", "configure"])
            .args(arguments)
            .current_dir(self.folder.path())
            .output()
            .expect("the program starts");
        let text = [output.stdout, output.stderr].concat();
        (
            output.status.code(),
            String::from_utf8_lossy(&text).into_owned(),
        )
    }

    fn assert_refused(&self, arguments: &[&str], parts: &[&str]) {
        let (code, text) = self.run(arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {text}");
        for part in parts {
            assert!(text.contains(part), "{arguments:?}: {text}");
        }
    }
}

fn flash(path: &Path) -> Vec<u8> {
    let image = Image::open(path).expect("it is an image");
    image.bytes[place(&image).expect("it has the place")].to_vec()
}

#[test]
fn a_configuration_is_written_and_shown() {
    let case = Case::new("[run]\ncontrol_rate_hz = 500.0\n[dither]\nwaveform = \"sine\"\n");
    let written = case.run(&["--config", "vehicle.toml", "--out", "out.elf", "ecu"]);
    assert_eq!(written.0, Some(0), "{}", written.1);
    assert!(
        written.1.contains("belongs to the experiment"),
        "{}",
        written.1
    );
    let scenario = load(&flash(&case.path("out.elf")), "mps2", CLOCK_HZ).expect("it passes");
    assert_eq!(scenario.run.control_rate_hz, 500.0);
    assert_eq!(scenario.dither.start_time_s, 0.0);
    // Nothing else of the image has changed.
    let (before, after) = (fs::read(case.path("ecu")), fs::read(case.path("out.elf")));
    let (before, after) = (before.expect("it is there"), after.expect("it is there"));
    let changed = before.iter().zip(&after).filter(|(a, b)| a != b).count();
    assert_eq!(before.len(), after.len());
    assert!(changed > 100 && changed < 2 * BLOCK_LEN, "{changed} bytes");

    let (code, shown) = case.run(&["--show", "out.elf"]);
    assert_eq!(code, Some(0), "{shown}");
    assert!(shown.contains("control_rate_hz = 500.0"), "{shown}");
    // What is shown is a configuration.
    fs::write(case.path("vehicle.toml"), &shown).expect("it can be written");
    let again = case.run(&["--config", "vehicle.toml", "--out", "again.elf", "ecu"]);
    assert_eq!(again.0, Some(0), "{}", again.1);
    assert_eq!(flash(&case.path("again.elf")), flash(&case.path("out.elf")));
}

#[test]
fn an_image_without_a_configuration_is_shown_as_that() {
    let case = Case::new("");
    let (code, text) = case.run(&["--show", "ecu"]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("erased"), "{text}");
}

#[test]
fn limits_need_calibration_and_have_a_hard_bound() {
    let case = Case::new("[gate]\nmotor_voltage_v = 5.0\n");
    let arguments = ["--config", "vehicle.toml", "--out", "out.elf", "ecu"];
    case.assert_refused(&arguments, &["--calibrate"]);
    assert!(!case.path("out.elf").exists());
    let calibrated = case.run(&[&["--calibrate"], &arguments[..]].concat());
    assert_eq!(calibrated.0, Some(0), "{}", calibrated.1);
    let scenario = load(&flash(&case.path("out.elf")), "mps2", CLOCK_HZ).expect("it passes");
    assert_eq!(scenario.gate.motor_voltage_v, 5.0);

    // A change of the application keeps the limits of the image.
    fs::write(
        case.path("vehicle.toml"),
        "[run]\ncontrol_rate_hz = 500.0\n",
    )
    .expect("written");
    let arguments = ["--config", "vehicle.toml", "--out", "next.elf", "out.elf"];
    let (code, text) = case.run(&arguments);
    assert_eq!(code, Some(0), "{text}");
    let scenario = load(&flash(&case.path("next.elf")), "mps2", CLOCK_HZ).expect("it passes");
    assert_eq!(scenario.gate.motor_voltage_v, 5.0);
    assert_eq!(scenario.run.control_rate_hz, 500.0);

    fs::write(
        case.path("vehicle.toml"),
        "[gate]\nmotor_voltage_v = 500.0\n",
    )
    .expect("written");
    let arguments = [
        "--calibrate",
        "--config",
        "vehicle.toml",
        "--out",
        "wide.elf",
        "ecu",
    ];
    case.assert_refused(&arguments, &["gate.motor_voltage_v = 500", "to"]);
}

#[test]
fn bad_input_is_refused_and_nothing_is_written() {
    let case = Case::new("[vehicle]\nmass_kg = 0.0\n");
    fs::copy(image("bench").path, case.path("bench")).expect("it can be copied");
    fs::write(case.path("text"), "no image").expect("it can be written");
    fs::write(case.path("there.elf"), "keep").expect("it can be written");
    let out = ["--out", "out.elf"];
    case.assert_refused(&["ecu"], &["--out"]);
    case.assert_refused(&["--show", "--out", "out.elf", "ecu"], &["--show", "--out"]);
    case.assert_refused(
        &[&out[..], &["bench"]].concat(),
        &["no configuration section"],
    );
    case.assert_refused(&[&out[..], &["text"]].concat(), &["not an ELF file"]);
    case.assert_refused(&[&out[..], &["missing"]].concat(), &["missing"]);
    case.assert_refused(&["--out", "there.elf", "ecu"], &["there.elf", "--force"]);
    case.assert_refused(&["--out", "ecu", "--force", "ecu"], &["ecu"]);
    let config = ["--config", "vehicle.toml"];
    case.assert_refused(
        &[&config[..], &out, &["ecu"]].concat(),
        &["vehicle.mass_kg = 0"],
    );
    case.assert_refused(
        &[&["--board", "abc"], &out[..], &["ecu"]].concat(),
        &["abc"],
    );
    case.assert_refused(
        &[&["--calibrate"], &out[..], &["ecu"]].concat(),
        &["--config"],
    );
    assert!(!case.path("out.elf").exists());
    assert_eq!(
        fs::read(case.path("there.elf")).expect("it is there"),
        b"keep"
    );
}

/// Both formats hold the same flash: the vector table at its start, the configuration at its place.
#[test]
fn binary_and_intel_hex_have_the_content_of_the_elf() {
    let case = Case::new("");
    for name in ["out.elf", "out.bin", "out.hex"] {
        let (code, text) = case.run(&["--out", name, "ecu"]);
        assert_eq!(code, Some(0), "{text}");
    }
    let elf = Image::open(&case.path("out.elf")).expect("it is an image");
    let binary = fs::read(case.path("out.bin")).expect("it is there");
    let first = elf
        .flash()
        .first()
        .map(|(address, _)| *address)
        .expect("it has flash");
    let mut from_hex = vec![0xFF; binary.len()];
    let text = fs::read_to_string(case.path("out.hex")).expect("it is text");
    let mut upper = 0;
    for line in text.lines() {
        let digits = line.strip_prefix(':').expect("a record");
        let bytes: Vec<u8> = (0..digits.len() / 2)
            .map(|i| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).expect("hexadecimal"))
            .collect();
        let sum = bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        assert_eq!(sum, 0, "{line}");
        let data = &bytes[4..bytes.len() - 1];
        let address = u32::from(bytes[1]) << 8 | u32::from(bytes[2]);
        match bytes[3] {
            0 => {
                let at = (upper + address - first) as usize;
                from_hex[at..at + data.len()].copy_from_slice(data);
            }
            4 => upper = u32::from(data[0]) << 24 | u32::from(data[1]) << 16,
            1 => assert!(data.is_empty()),
            other => panic!("record {other}"),
        }
    }
    assert!(from_hex == binary, "both formats hold the same bytes");
    for (address, part) in elf.flash() {
        let at = (address - first) as usize;
        assert!(binary[at..at + part.len()] == *part, "{address:#x}");
    }
    let scenario = load(&flash(&case.path("out.elf")), "mps2", CLOCK_HZ);
    assert_eq!(
        scenario.map(|it| it.run),
        Ok(Scenario::reconstruction().run)
    );
}
