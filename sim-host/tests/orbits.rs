//! Regions and orbit diagrams.
use shared_model::Scenario;
use sim_host::chaos::regions::*;
use sim_host::chaos::sweep::*;
#[test]
fn explore() {
    let stop = std::sync::atomic::AtomicBool::new(false);
    for (tr, time) in [(200.0, 600.0), (1000.0, 2000.0)] {
        let t = std::time::Instant::now();
        let values = Values::new("", 1600.0, 1900.0, 5.0).unwrap();
        let r = regions(
            &Scenario::reconstruction(),
            Parameter::Speed,
            &values,
            0.5,
            Timing::new(tr, time).unwrap(),
            Watch {
                stop: &stop,
                done: &|| {},
            },
        )
        .unwrap();
        println!("{time} {:?}, {} samples", t.elapsed(), r.samples.len());
        for e in &r.regions {
            println!("{:.2} {:.2} {}", e.from, e.to, e.kind);
        }
        for e in &r.samples {
            if e.value > 1815.0 && e.value < 1865.0 {
                println!(
                    "   {} {} {:?} {:?} {:?}",
                    e.value,
                    e.attractor.kind,
                    e.attractor.residual,
                    e.attractor.exponent_per_s,
                    e.attractor.exponent_threshold_per_s
                );
            }
        }
    }
}
