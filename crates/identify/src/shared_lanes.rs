//! Strengths that act at different times can be moved in one simulation: each sample's change
//! then belongs to the one that acted last. A spline of eighty knots costs a handful of
//! simulations instead of eighty.

use kort_thruster::effects::Stretch;

/// How long a response lasts after its cause, s; what is left then is negligible in a derivative.
const SETTLED_S: f64 = 4.0;

/// Sorts strengths into groups that do not meet: each a list of (place, stretch) in order of time.
pub fn groups(mut acting: Vec<(usize, Stretch)>) -> Vec<Vec<(usize, Stretch)>> {
    acting.sort_by(|a, b| a.1.from_s.total_cmp(&b.1.from_s));
    let mut groups: Vec<Vec<(usize, Stretch)>> = Vec::new();
    for one in acting {
        let apart = one.1.length_s + SETTLED_S;
        let fits = |group: &Vec<(usize, Stretch)>| {
            let (first, last) = (group[0].1, group[group.len() - 1].1);
            first.period_s == one.1.period_s
                && one.1.from_s >= last.from_s + apart
                && first.from_s + first.period_s >= one.1.from_s + apart
        };
        match groups.iter_mut().find(|g| fits(g)) {
            Some(group) => group.push(one),
            None => groups.push(vec![one]),
        }
    }
    groups
}

/// Place in its group of the strength that acted last at a time.
pub fn last_acting(group: &[(usize, Stretch)], time_s: f64) -> usize {
    let since = |s: &Stretch| (time_s - s.from_s).rem_euclid(s.period_s);
    (0..group.len()).min_by(|a, b| since(&group[*a].1).total_cmp(&since(&group[*b].1))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knot(k: usize) -> (usize, Stretch) {
        (k, Stretch { from_s: 1.5 * (k as f64 - 1.0), length_s: 3.0, period_s: 60.0 })
    }

    #[test]
    fn members_of_a_group_never_meet_and_none_is_lost() {
        let groups = groups((0..40).map(knot).collect());
        assert!(groups.len() < 8, "{}", groups.len());
        let mut seen: Vec<usize> = groups.iter().flatten().map(|m| m.0).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..40).collect::<Vec<_>>());
        for group in &groups {
            for (i, a) in group.iter().enumerate() {
                for b in &group[i + 1..] {
                    let gap = (b.1.from_s - a.1.from_s).rem_euclid(60.0);
                    assert!(gap >= 7.0 && 60.0 - gap >= 7.0, "{gap}");
                }
            }
        }
    }

    #[test]
    fn the_last_to_act_owns_the_sample() {
        let group = vec![knot(0), knot(10), knot(20)];
        assert_eq!(last_acting(&group, 0.0), 0);
        assert_eq!(last_acting(&group, 13.4), 0);
        assert_eq!(last_acting(&group, 13.6), 1);
        assert_eq!(last_acting(&group, 57.0), 2);
        assert_eq!(last_acting(&group, 59.0), 0);
    }
}
