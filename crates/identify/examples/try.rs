use kort_identify::{baseline, data::*, fit::*, noise::Whitener, search};
use kort_thruster::{models::ModelName, parameters::Parameters, rig::Rig};
use std::time::Instant;
fn main() {
    let dir = std::env::args().nth(1).unwrap();
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
    let time = cols.remove(0);
    let series =
        Series { name: dir.clone(), time_s: time, columns: names[1..].iter().cloned().zip(cols).collect() };
    let prepared = Prepared::new(&series, &rig, false).unwrap();
    let whiteners =
        vec![prepared.channels.iter().map(|c| Whitener::flat(0.02 * c.full_scale, c.rows.len())).collect()];
    let masked = vec![vec![false; prepared.time_s.len()]];
    let problem = Problem {
        model: ModelName::Model2,
        rig: &rig,
        stated: Parameters::stated(&rig),
        recordings: vec![prepared],
        whiteners,
        masked,
    };
    let h = baseline::hypothesis(ModelName::Model2, &rig, false, true);
    let scale = scale(&problem.recordings, &rig);
    let avail = available(&[series], &problem.recordings);
    for _ in 0..2 {
        let t = Instant::now();
        let r = problem.respond(&h, &h.start);
        println!("sim {:?}", t.elapsed());
        let t = Instant::now();
        problem.whiten(&r);
        println!("whiten {:?}", t.elapsed());
    }
    let mut search = search::Search::new(problem, scale, &avail);
    let t = Instant::now();
    let mut current = search.baseline(&h);
    println!("baseline {:?} chi2 {:.1} pen {:.1}", t.elapsed(), current.chi2, current.penalty);
    let mut so_far = 0.0;
    for _ in 0..3 {
        let t = Instant::now();
        let Some(round) = search.round(&mut current, so_far) else {
            println!("nothing more {:?}", t.elapsed());
            break;
        };
        println!(
            "round {:?} gain {:.1} left out {:.1}+-{:.1} size {:.4} before {:.1}",
            t.elapsed(),
            round.gain,
            round.left_out.0,
            round.left_out.1,
            round.size,
            search::criterion(&round.before)
        );
        for c in &round.candidates {
            println!(
                "   {} crit {:+.1} screened {:.0} {:?}",
                c.effect.id,
                c.criterion - round.candidates[0].criterion,
                c.screened,
                &c.fit.values[current.values.len()..]
            );
        }
        if round.gain < search::rules::BELIEVE
            || round.size < search::rules::LEAST_SIZE
            || round.left_out.0 < 0.4 * round.gain
        {
            println!("   not accepted");
            break;
        }
        so_far += round.gain;
        current = round.candidates[0].fit.clone();
    }
}
