//! Names that only undo each other.

use kort_identify::fit::Fit;
use kort_identify::simulate::Problem;

/// Share of what one effect does that two do together, below which they mostly undo each other.
const LEFT_OF_BOTH: f64 = 0.5;

/// Pairs of effects of a fit, with a size each, that mostly undo each other: together they do less than half of what either
/// does alone (mean squares over the noise). Each is then needed for what the other does too much, and what is left of both
/// may be one thing that is neither: a limit that bends as a curve less a dead band does.
pub fn cancelling(problem: &Problem, fit: &Fit, actions: &[Vec<f64>]) -> Vec<(&'static str, &'static str)> {
    let counted = problem.spectrum.bands.iter().zip(&fit.noise.weight);
    let counted: Vec<f64> = counted.map(|(band, weight)| weight * band.lines.len() as f64).collect();
    let size = |action: &[f64]| counted.iter().zip(action).map(|(n, power)| n * power).sum::<f64>();
    let members = &fit.hypothesis.effects;
    let has_size = |k: &usize| members[*k].has_size(&problem.scale);
    let sized: Vec<usize> = (0..members.len()).filter(has_size).collect();
    let pairs = sized.iter().enumerate().flat_map(|(n, a)| sized[..n].iter().map(move |b| (*b, *a)));
    let undo = |(a, b): &(usize, usize)| {
        let least = size(&actions[*a]).min(size(&actions[*b]));
        size(&problem.action_of(fit, &[*a, *b])) < LEFT_OF_BOTH * least
    };
    pairs.filter(undo).map(|(a, b)| (members[a].effect.id, members[b].effect.id)).collect()
}

#[cfg(test)]
mod tests {
    use kort_identify::hypothesis::Member;
    use kort_thruster::effects::{command_curve, command_dead_band};

    use super::cancelling;
    use crate::stand;

    /// A dead band of 0.2 A of 5 A, and a curve that is so much of the command above the straight line.
    fn beside_a_curve_of(above: f64) -> Vec<(&'static str, &'static str)> {
        stand::left(
            |_, _, noise| noise,
            |problem, fit, _| {
                let full = problem.scale.command;
                let band = Member::new(&command_dead_band::DESCRIPTOR, &problem.scale).at(vec![
                    0.04 * full,
                    0.0,
                    0.0,
                ]);
                let curve = Member::new(&command_curve::DESCRIPTOR, &problem.scale);
                let curve = curve.at(vec![0.0, 0.0, full, above, above, above, above]);
                let with_band = fit.hypothesis.with(&fit.values, band, &problem.scale);
                let both = with_band.with(&with_band.start, curve, &problem.scale);
                let fit = problem.finish(problem.fit(&both, &Vec::new(), &problem.floor, 0));
                cancelling(problem, &fit, &problem.actions(&fit))
            },
        )
    }

    #[test]
    fn a_curve_that_makes_up_for_a_dead_band_undoes_it_and_one_that_adds_to_it_does_not() {
        assert_eq!(beside_a_curve_of(0.04), [("command_dead_band", "command_curve")]);
        assert_eq!(beside_a_curve_of(-0.04), []);
    }
}
