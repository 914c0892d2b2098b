//! The page in a browser: what a user sees, and the bits of its model against the firmware's
//! telemetry.

use dynamics::lyapunov;
use dynamics::simulate::simulate;
use plot::canvas::{Colour, Line};
use plot::style;
use qemu::{Machine, settings};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{record_with, root};

/// Greatest size of the page, bytes.
const MOST_BYTES: u64 = 300_000;
/// Greatest difference of the exponent in the browser from the host's: their logarithms differ in
/// the last bit.
const EXPONENT_TOLERANCE_PER_S: f64 = 1e-9;

fn target() -> PathBuf {
    let own = Path::new(env!("CARGO_TARGET_TMPDIR"));
    own.parent().expect("it is in the target folder").to_owned()
}

fn page() -> PathBuf {
    let page = target().join("page").join("index.html");
    assert!(
        page.is_file(),
        "{} is not built: run `cargo xtask page`",
        page.display()
    );
    page
}

/// Node.js, Chromium and their driver, as set-up installs them; `None` with a message where they
/// are missing.
fn browser() -> Option<[PathBuf; 3]> {
    let folder = target().join("browser");
    let tools = ["node", "chromium", "package.json"].map(|name| folder.join(name));
    if folder.join("complete").is_file() && tools.iter().all(|tool| tool.exists()) {
        return Some(tools);
    }
    // Past the test harness, which would keep it.
    let _ = writeln!(
        std::io::stderr(),
        "UNTESTED: the page in a browser: Chromium or Node.js is missing: run `cargo xtask setup`"
    );
    None
}

/// A run of 10,000 steps.
fn scenario() -> Scenario<f32> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.duration_s = 10.0;
    scenario.dither.waveform = Waveform::Sine;
    scenario.dither.amplitude_v = 1.0;
    scenario
}

#[test]
fn the_page_works_in_a_browser_with_the_firmwares_bits() {
    let page = page();
    let Some([node, chromium, driver]) = browser() else {
        return;
    };
    let scenario = scenario();
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let settings = settings::of(&scenario).join("&");
    let output = Command::new(node)
        .arg(root().join("tests/browser/page.mjs"))
        .args([&driver, &chromium, &page])
        .arg(folder.path())
        .arg(settings)
        .output()
        .expect("node starts");
    assert!(
        output.status.success(),
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );

    let read =
        |name: &str| fs::read(folder.path().join(name)).expect("the page's words were written");
    let recording = record_with(&scenario, Machine::Mps2An386, 0, &["pace=host"]);
    let (states, duties) = (read("states.bin"), read("duties.bin"));
    assert_eq!(recording.records.len(), 10_000);
    let words = recording.records.iter().flat_map(|record| {
        let words: [f32; 4] = record.state.x.into();
        words.map(f32::to_bits)
    });
    let in_browser = states.chunks_exact(4);
    let in_browser =
        in_browser.map(|word| u32::from_le_bytes(word.try_into().expect("four bytes")));
    assert!(in_browser.eq(words), "a word of the states differs");
    let in_browser = duties.chunks_exact(2);
    let in_browser = in_browser.map(|code| u16::from_le_bytes(code.try_into().expect("two bytes")));
    assert!(in_browser.eq(recording.duties), "a duty code differs");

    let text = String::from_utf8(read("exponent.txt")).expect("it is a number");
    let in_browser: f64 = text.parse().expect("the page measured an exponent");
    let on_host = exponent_per_s();
    assert!(
        (in_browser - on_host).abs() < EXPONENT_TOLERANCE_PER_S,
        "{in_browser} in the browser, {on_host} on the host"
    );
}

/// The exponent of the paper's chaos over the times of the page.
fn exponent_per_s() -> f64 {
    let mut scenario = Scenario::<f32>::reconstruction();
    scenario.run.duration_s = 303.0;
    let trace = simulate(&scenario).expect("the scenario is valid");
    let from = trace.index_after(103.0);
    let exponent = lyapunov::largest(&scenario.map(&f64::from), &trace, from);
    exponent.expect("the motion is long enough").per_s
}

#[test]
fn the_page_is_one_small_file() {
    let page = page();
    let bytes = fs::metadata(&page).expect("it is there").len();
    assert!(bytes <= MOST_BYTES, "{bytes} bytes");
    let text = fs::read_to_string(&page).expect("it is a text");
    for outside in ["src=", "<link", "@import", "url(", "fetch(", "import("] {
        assert!(!text.contains(outside), "{outside} refers to another file");
    }
}

/// The page's colours are those of the figures.
#[test]
fn the_pages_colours_are_those_of_the_figures() {
    let text = fs::read_to_string(root().join("page/web/style.css")).expect("it can be read");
    let light = text.split("@media").next().expect("the first colours");
    let of = |Line { colour, .. }: Line| colour;
    for (name, Colour(r, g, b)) in [
        ("ink", style::INK),
        ("faint", style::FAINT_INK),
        ("grid", style::GRID),
        ("main", of(style::MAIN)),
        ("other", of(style::OTHER)),
        ("alone", of(style::ALONE)),
        ("limit", of(style::LIMIT)),
        ("instant", of(style::INSTANT)),
        ("mark", of(style::RUNS[1])),
    ] {
        let line = format!("--{name}: #{r:02x}{g:02x}{b:02x};");
        assert!(light.contains(&line), "{line}");
    }
}
