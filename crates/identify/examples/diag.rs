//! Development: diagnoses case folders (`recording.csv`, `rig.toml`) and prints one line each.
use kort_identify::data::Series;
use kort_identify::diagnose::{Options, diagnose};
use kort_thruster::{models::ModelName, rig::Rig};

fn main() {
    let json = std::env::args().any(|a| a == "--json");
    let model: ModelName = std::env::var("MODEL").map_or(ModelName::Model2, |m| m.parse().unwrap());
    let drop: Vec<String> = std::env::var("DROP").unwrap_or_default().split(',').map(String::from).collect();
    for dir in std::env::args().skip(1).filter(|a| a != "--json") {
        let rig = Rig::from_toml(&std::fs::read_to_string(format!("{dir}/rig.toml")).unwrap()).unwrap();
        let text = std::fs::read_to_string(format!("{dir}/recording.csv")).unwrap();
        let mut lines = text.lines();
        let names: Vec<String> = lines.next().unwrap().split(',').map(String::from).collect();
        let mut cols: Vec<Vec<f64>> = vec![vec![]; names.len()];
        for l in lines {
            for (i, c) in l.split(',').enumerate() {
                cols[i].push(c.parse().unwrap_or(f64::NAN));
            }
        }
        let time_s = cols.remove(0);
        let series = Series {
            name: dir.clone(),
            time_s,
            columns: names[1..].iter().cloned().zip(cols).filter(|c| !drop.contains(&c.0)).collect(),
        };
        let t = std::time::Instant::now();
        let d = diagnose(&[series], &rig, &Options { model, seed: 1 }, &|m: &str| {
            if std::env::var("TRACE").is_ok() {
                eprintln!("{:.2} {m}", cpu())
            }
        })
        .unwrap();
        let r = &d.report;
        if json {
            println!("{}", serde_json::to_string_pretty(r).unwrap());
        }
        let f: Vec<String> = r
            .findings
            .iter()
            .map(|f| {
                format!("{} {:.2} removed {:.2}", f.effect, f.probability, f.heldout.excess_error_removed)
            })
            .collect();
        let truth = std::fs::read_to_string(format!("{dir}/answer.json")).unwrap_or_default();
        let truth: serde_json::Value = serde_json::from_str(&truth).unwrap_or_default();
        println!(
            "{dir} {:?} {:?} [{}] term {:?} alt {:?} truth {} {:.1} s",
            r.verdict,
            r.mismatch.iter().map(|m| (m.path.as_str(), m.significance_sigma as i64)).collect::<Vec<_>>(),
            f.join("; "),
            r.empirical_term.as_ref().map(|t| &t.expression),
            r.alternatives
                .iter()
                .take(3)
                .map(|a| (a.effect.as_str(), &a.why_not[..20.min(a.why_not.len())]))
                .collect::<Vec<_>>(),
            truth,
            t.elapsed().as_secs_f64()
        );
    }
}

fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    s.rsplit(')').next().unwrap().split_whitespace().nth(11).unwrap().parse::<f64>().unwrap() / 100.0
}
