//! The map: the same bytes however it is made, against the analysis of single motions, and bad
//! input.

mod common;

use common::{assert_ends, command, folder};
use dynamics::attractor::{Kind, attractor};
use dynamics::map::cell::{self, Cell, cells};
use dynamics::map::plan::{Grid, Place, Plan, Sheet, Start};
use dynamics::map::table::PLAN_KEY;
use dynamics::map::tiles::resealed;
use dynamics::sweep::Timing;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;

/// A map of 288 cells in three tiles, the last one not full.
const SMALL: &str = "map --speeds 12 --amplitudes 12 --transient 5 --time 15";

fn assert_well(folder: &Path, threads: &str, line: &str) {
    let mut command = command(folder, line.split_whitespace());
    assert_ends(command.env("RAYON_NUM_THREADS", threads), 0);
}

/// Expects exit code 2, a message with all of `parts`, and no file `o.csv`.
fn assert_refused(folder: &Path, line: &str, parts: &[&str]) {
    common::assert_refused(folder, line.split_whitespace(), parts);
    assert!(!folder.join("o.csv").exists(), "{line}");
}

fn files(name: &str) -> String {
    format!("--out {name}.csv --parquet {name}.parquet --figure {name}.svg")
}

fn assert_same(folder: &Path, one: &str, other: &str) {
    for kind in ["csv", "parquet", "svg"] {
        let read = |name| fs::read(folder.join(format!("{name}.{kind}"))).expect("it is written");
        assert!(
            read(one) == read(other),
            "{one} and {other} differ in {kind}"
        );
    }
}

#[test]
fn the_same_bytes_for_any_threads_interruptions_and_shards() {
    let folder = folder();
    let at = folder.path();
    assert_well(at, "1", &format!("{SMALL} {}", files("one")));
    assert_well(at, "2", &format!("{SMALL} {}", files("two")));
    assert_same(at, "one", "two");
    // As after an interruption: some tiles are there.
    fs::remove_file(at.join("two.csv.tiles/tile-000001.csv")).unwrap();
    assert_well(
        at,
        "2",
        &format!("{SMALL} --work two.csv.tiles {}", files("again")),
    );
    assert_same(at, "one", "again");
    assert_well(at, "1", &format!("{SMALL} --shard 1/2 --work a"));
    assert_refused(
        at,
        "map merge a --out o.csv",
        &[
            "1 of 3 tiles",
            "missing: 1;",
            "repeat the `map` command",
            "--shard",
        ],
    );
    assert_well(at, "2", &format!("{SMALL} --shard 2/2 --work b"));
    assert_well(at, "1", &format!("map merge b a {}", files("merged")));
    assert_same(at, "one", "merged");
}

/// Peak memory of a merge in the middle of its table, kB.
fn peak_of_merge_kb(work: &str, cells: usize, folder: &Path) -> usize {
    let mut merge = command(folder, ["map", "merge", work, "--out", "-"]);
    let mut merge = merge.stdout(Stdio::piped()).spawn().unwrap();
    let mut rows = BufReader::new(merge.stdout.take().unwrap()).lines();
    // The rest does not fit into the pipe, so that the program waits.
    assert!(rows.nth(cells / 2).is_some());
    let status = fs::read_to_string(format!("/proc/{}/status", merge.id())).unwrap();
    let peak = status
        .split_once("VmHWM:")
        .and_then(|(_, rest)| rest.split_whitespace().next());
    let peak = peak.expect("Linux reports it").parse().unwrap();
    assert_eq!(rows.count(), cells - cells / 2);
    assert!(merge.wait().unwrap().success());
    peak
}

/// A hundred thousand cells would take 14 MB.
#[test]
fn the_memory_of_a_merge_does_not_grow_with_the_map() {
    let folder = folder();
    let at = folder.path();
    let peaks = [100, 1000].map(|speeds| {
        let plan = format!("--dither square --speeds {speeds} --amplitudes 100");
        let run = format!("map {plan} --transient 0.1 --time 0.2 --work {speeds}");
        assert_well(at, "2", &format!("{run} --shard 1/1"));
        peak_of_merge_kb(&speeds.to_string(), speeds * 100, at)
    });
    assert!(peaks[1] < peaks[0] + 4_000, "{peaks:?} kB");
}

#[test]
fn tiles_of_another_plan_or_damaged_ones_are_refused() {
    let folder = folder();
    let at = folder.path();
    let small = "map --dither square --speeds 12 --amplitudes 12 --transient 5";
    assert_well(at, "2", &format!("{small} --time 15 --work w"));
    let another = format!("{small} --time 16 --work w --out o.csv");
    let parts = [
        "tiles of another map",
        "observed_s is 10.0, not 11.0",
        "separate work folders",
    ];
    assert_refused(at, &another, &parts);
    assert_well(at, "2", &format!("{small} --time 16 --work v --shard 1/1"));
    let parts = [
        "v holds tiles of another map",
        "observed_s is 11.0, not 10.0",
    ];
    assert_refused(at, "map merge w v --out o.csv", &parts);
    let second = "tile-000001.csv";
    let own = fs::read(at.join("w").join(second)).unwrap();
    fs::copy(at.join("v").join(second), at.join("w").join(second)).unwrap();
    let parts = [second, "another map", "observed_s is 11.0, not 10.0"];
    assert_refused(at, "map merge w --out o.csv", &parts);
    fs::remove_file(at.join("w").join(second)).unwrap();
    let parts = ["1 of 2 tiles are missing: 1;", "repeat the `map` command"];
    assert_refused(at, "map merge w --out o.csv", &parts);
    assert_refused(at, "map merge w none --out o.csv", &["cannot read none"]);
    fs::write(at.join("w").join(second), own).unwrap();
    let tile = at.join("w/tile-000000.csv");
    let text = fs::read_to_string(&tile).unwrap();
    let (cut, _) = text.trim_end().rsplit_once('\n').unwrap();
    fs::write(&tile, cut).unwrap();
    let parts = ["tile-000000.csv", "check sum", "delete it"];
    assert_refused(at, "map merge w --out o.csv", &parts);
    fs::write(&tile, resealed(cut)).unwrap();
    let parts = ["tile-000000.csv", "not complete", "delete it"];
    assert_refused(at, "map merge w --out o.csv", &parts);
    fs::write(&tile, "no tile").unwrap();
    assert_refused(at, "map merge w --out o.csv", &["cannot use", "delete it"]);
    fs::create_dir(at.join("empty")).unwrap();
    assert_refused(at, "map merge empty --out o.csv", &["empty has no tiles"]);
}

/// Whatever digit of a tile is edited, and whatever its plan says with a check sum that fits: no
/// number goes into a result, and none is counted by.
#[test]
fn edited_tiles_are_refused() {
    let folder = folder();
    let at = folder.path();
    let small = "map --dither square --speeds 3 --amplitudes 3 --transient 1 --time 3 --work w";
    assert_well(at, "2", &format!("{small} --out own.csv"));
    let tile = at.join("w/tile-000000.csv");
    let whole = fs::read_to_string(&tile).unwrap();
    let merge = "map merge w --out o.csv";
    let digits = whole.char_indices().filter(|(_, c)| c.is_ascii_digit());
    for (digit, _) in digits.step_by(97) {
        let mut edited = whole.clone().into_bytes();
        edited[digit] = b'0' + (edited[digit] - b'0' + 1) % 10;
        fs::write(&tile, edited).unwrap();
        assert_refused(at, merge, &["tile-000000.csv", "check sum", "delete it"]);
    }
    let count = r#""count":3"#;
    let (before, from_sheets) = whole.split_once(r#""sheets":["#).unwrap();
    let (_, after) = from_sheets.split_once("],").unwrap();
    let without_sheets = format!(r#"{before}"sheets":[],{after}"#);
    let number = |key: &str, value: &str| {
        let from = whole.find(key).unwrap() + key.len();
        let length = whole[from..].find([',', '}']).unwrap();
        format!("{}{value}{}", &whole[..from], &whole[from + length..])
    };
    for (edited, part) in [
        (without_sheets, "0 sheets"),
        (whole.replacen(count, r#""count":0"#, 2), "0 values"),
        (
            whole.replacen(count, r#""count":1000000000000"#, 2),
            "1 to 10000000",
        ),
        (
            whole.replacen(count, r#""count":9223372036854775808"#, 2),
            "the same number",
        ),
        (whole.replacen(count, r#""count":4"#, 1), "not complete"),
        (number(r#""observed_s":"#, "-2.0"), "transient"),
        (number(r#""observed_s":"#, "0.0"), "transient"),
        (number(r#""observed_s":"#, "1e300"), "1000000 s"),
        (number(r#""observed_s":"#, "1e999"), "cannot use"),
        (number(r#""observed_s":"#, "null"), "cannot use"),
        (number(r#""transient_s":"#, "-1.0"), "transient"),
        (number(r#""transient_s":"#, "NaN"), "cannot use"),
        (number(r#""mass_kg":"#, "-1500.0"), "mass_kg = -1500"),
        (number(r#"{"tile":"#, "1"), "tile 1 of 1"),
        (
            number(r#"{"tile":"#, "18446744073709551615"),
            "tile 18446744073709551615 of 1",
        ),
        (number("square,given,", "999.0"), "not complete"),
        (whole.replacen("undecided", "diverges", 1), "diverges_at_s"),
    ] {
        assert_ne!(edited, whole, "{part}");
        fs::write(&tile, resealed(&edited)).unwrap();
        assert_refused(at, merge, &["tile-000000.csv", part, "delete it"]);
        // The same where work continues.
        assert_refused(
            at,
            &format!("{small} --out o.csv"),
            &["tile-000000.csv", "delete it"],
        );
    }
    fs::write(&tile, resealed(&whole)).unwrap();
    assert_well(at, "2", &format!("{merge} --force"));
    let read = |name: &str| fs::read(at.join(name)).unwrap();
    assert!(read("o.csv") == read("own.csv"));
    // A file of 10 GB is not read.
    let long = fs::File::options().write(true).open(&tile).unwrap();
    long.set_len(10 << 30).unwrap();
    fs::remove_file(at.join("o.csv")).unwrap();
    assert_refused(at, merge, &["tile-000000.csv", "longer than"]);
}

#[test]
fn bad_input_is_refused() {
    let folder = folder();
    let at = folder.path();
    for (rest, parts) in [
        ("--shard 0/3 --work w", &["0/3", "i from 1 to n"][..]),
        ("--shard 4/3 --work w", &["4/3", "i from 1 to n"]),
        ("--shard 1/0 --work w", &["1/0", "i from 1 to n"]),
        ("--shard one --work w", &["one", "2/4"]),
        ("--shard 1/2", &["--work"]),
        ("--shard 1/2 --work w --out o.csv", &["--shard", "--out"]),
        ("--out o.csv --from nan", &["wheel speed", "NaN", "finite"]),
        ("--out o.csv --step 0", &["wheel speed", "in steps of 0"]),
        ("--out o.csv --step 10 --speeds 9", &["--step", "--speeds"]),
        (
            "--out o.csv --square-step 0.1 --amplitudes 9",
            &["--square-step", "--amplitudes"],
        ),
        (
            "--out o.csv --square-step 0.1 --sine-step 0.1",
            &["as many amplitudes"],
        ),
        ("--out o.csv --from -5", &["wheel_speed_rpm = -5", "from 1"]),
        (
            "--out o.csv --square-to -0.1",
            &["amplitude_v = -0.1", "from 0"],
        ),
        ("--out o.csv --sine-to inf", &["amplitude", "inf", "finite"]),
        (
            "--out o.csv --speeds 1",
            &["wheel speed", "1 value from 1000 to 2000", "at least two"],
        ),
        (
            "--out o.csv --amplitudes 0",
            &["amplitude", "0 values", "at least two"],
        ),
        (
            "--out o.csv --speeds 100000 --amplitudes 100000",
            &["20000000000 cells", "1 to 10000000"],
        ),
        (
            "--out o.csv --transient 200",
            &["transient of 200 s", "shorter"],
        ),
        ("--out o.csv --time nan", &["NaN s"]),
        (
            "--out o.csv --preset printed",
            &["friction", "under the mean of a sine", "slide"],
        ),
        (
            "--out o.csv --preset printed --dither square",
            &["friction", "slide"],
        ),
        ("", &["--out, --parquet, --figure or --work"]),
    ] {
        assert_refused(at, &format!("map {rest}"), parts);
    }
    fs::write(at.join("there.csv"), "mine").unwrap();
    assert_refused(
        at,
        &format!("{SMALL} --out there.csv"),
        &["there.csv exists", "--force"],
    );
}

/// One cell as `sim-host map` makes it.
fn found(waveform: Waveform, wheel_speed_rpm: f64, dither_amplitude_v: f64) -> (Plan, Cell) {
    let place = Place {
        waveform,
        start: Start::Given,
        wheel_speed_rpm,
        dither_amplitude_v,
    };
    let grid = |value| Grid {
        from: value,
        to: value + 0.1,
        count: 2,
    };
    let sheet = Sheet {
        waveform,
        start: Start::Given,
        amplitudes_v: grid(dither_amplitude_v),
    };
    let timing = Timing::new(100.0, 200.0).unwrap();
    let speeds_rpm = grid(wheel_speed_rpm);
    let plan = Plan::new(Scenario::reconstruction(), vec![sheet], speeds_rpm, timing).unwrap();
    let cell = cells(&plan, &[place]).unwrap()[0];
    (plan, cell)
}

/// The other integrator, and the exponent by the linearised step.
#[test]
fn cells_agree_with_the_analysis_of_the_motion() {
    for (waveform, rpm, volts) in [
        (Waveform::Square, 1600.0, 0.0),
        (Waveform::Square, 1750.0, 0.0),
        (Waveform::Square, 1750.0, 0.1),
        (Waveform::Square, 1840.0, 0.0),
        (Waveform::Square, 1750.0, 0.19),
        (Waveform::Sine, 1750.0, 1.0),
    ] {
        let (plan, cell) = found(waveform, rpm, volts);
        let place = plan.places(0)[0];
        let timing = Timing::new(100.0, 200.0).unwrap();
        let known = attractor(&plan.motion(&place), timing, true).unwrap();
        let case = format!("{cell:?} {known:?}");
        let kind = match known.kind {
            Kind::Equilibrium => (cell::Kind::Equilibrium, Some(0)),
            Kind::Periodic(maxima) => (cell::Kind::Periodic, Some(maxima as u32)),
            Kind::Chaos | Kind::BandedChaos(_) => (cell::Kind::Chaos, None),
            Kind::Undecided => (cell::Kind::Undecided, None),
            Kind::Diverges | Kind::NotFollowed(_) => panic!("{case}"),
        };
        assert_eq!((cell.kind, cell.period), kind, "{case}");
        let (low, high) = known.yaw_rates_rad_per_s();
        let close = if kind.1.is_some() { 1e-3 } else { 0.05 };
        let extent = cell.yaw_rate_peak_to_peak_rad_per_s.unwrap();
        assert!((extent - (high - low)).abs() <= close * extent, "{case}");
        if let Some(exponent) = known.exponent_per_s {
            let both =
                cell.exponent_threshold_per_s.unwrap() + known.exponent_threshold_per_s.unwrap();
            assert!(
                (cell.exponent_per_s.unwrap() - exponent).abs() <= both,
                "{case}"
            );
        }
    }
}

#[test]
fn csv_and_parquet_hold_the_same() {
    let folder = folder();
    let at = folder.path();
    let tables = "--out map.csv --parquet map.parquet";
    assert_well(at, "2", &format!("{SMALL} --start both {tables}"));
    let mut csv = csv::Reader::from_path(at.join("map.csv")).unwrap();
    let cells: Vec<Cell> = csv.deserialize().collect::<Result<_, _>>().unwrap();
    assert_eq!(cells.len(), 576);
    let file = fs::File::open(at.join("map.parquet")).unwrap();
    let table = SerializedFileReader::new(file).unwrap();
    let metadata = table.metadata().file_metadata();
    let columns = metadata.schema_descr().columns().iter();
    let columns: Vec<_> = columns.map(|column| column.name().to_owned()).collect();
    let header = csv.headers().unwrap();
    assert_eq!(columns, header.iter().collect::<Vec<_>>());
    let keys = metadata.key_value_metadata().unwrap();
    let plan = keys.iter().find(|pair| pair.key == PLAN_KEY).unwrap();
    let plan: Plan = serde_json::from_str(plan.value.as_ref().unwrap()).unwrap();
    assert_eq!(plan.cells(), cells.len());
    let rows = table.get_row_iter(None).unwrap();
    let mut read = 0;
    for (row, cell) in rows.zip(&cells) {
        let row = row.unwrap();
        let name = |k| row.get_string(k).unwrap().clone();
        assert_eq!(name(0), format!("{:?}", cell.waveform).to_lowercase());
        assert_eq!(name(1), format!("{:?}", cell.start).to_lowercase());
        assert_eq!(name(4), format!("{:?}", cell.kind).to_lowercase());
        let count = |k| row.get_int(k).ok().map(|n| n as u32);
        assert_eq!([count(5), count(6)], [cell.period, cell.bands]);
        let numbers = [2, 3, 7, 8, 9, 10, 11, 12].map(|k| row.get_double(k).ok());
        let of_csv = [
            Some(cell.wheel_speed_rpm),
            Some(cell.dither_amplitude_v),
            cell.exponent_per_s,
            cell.exponent_standard_error_per_s,
            cell.exponent_threshold_per_s,
            cell.yaw_rate_peak_to_peak_rad_per_s,
            cell.steering_angle_peak_to_peak_rad,
            cell.diverges_at_s,
        ];
        assert_eq!(numbers, of_csv);
        read += 1;
    }
    assert_eq!(read, cells.len());
}
