//! How steps of the reference are followed.

use super::Sample;

/// Longest time after a step that is looked at, s.
const STEP_WINDOW_S: f64 = 6.0;
/// A step of the reference under way.
#[derive(Clone, Copy, Debug)]
struct Step {
    since_s: f64,
    from_n: f64,
    to_n: f64,
    risen_s: Option<f64>,
    outside_s: f64,
    beyond: f64,
}

/// Steps so far.
pub(super) struct Steps {
    dt_s: f64,
    scale_n: f64,
    under_way: Option<Step>,
    last_reference_n: Option<f64>,
    /// Times to 90 %, s.
    pub(super) rises: Vec<f64>,
    /// Times until thrust stays, s.
    pub(super) settles: Vec<f64>,
    /// Overshoots, %.
    pub(super) overshoots: Vec<f64>,
}

impl Steps {
    /// For a tick, s, and a thruster's largest thrust, N.
    pub(super) fn new(dt_s: f64, scale_n: f64) -> Self {
        Self {
            dt_s,
            scale_n,
            under_way: None,
            last_reference_n: None,
            rises: Vec::new(),
            settles: Vec::new(),
            overshoots: Vec::new(),
        }
    }

    /// A reference that is not scored: the next one is a step from it.
    pub(super) fn begin_at(&mut self, reference_n: f64) {
        self.last_reference_n = Some(reference_n);
    }

    /// One tick.
    pub(super) fn tick(&mut self, s: &Sample) {
        let last = self.last_reference_n.replace(s.reference_n).unwrap_or(s.reference_n);
        let change = s.reference_n - last;
        if change != 0.0 || s.excused {
            self.close();
            if change.abs() > 0.05 * self.scale_n && !s.excused {
                self.under_way = Some(Step {
                    since_s: 0.0,
                    from_n: s.thrust_n,
                    to_n: s.reference_n,
                    risen_s: None,
                    outside_s: 0.0,
                    beyond: 0.0,
                });
            }
        }
        if let Some(step) = &mut self.under_way {
            step.since_s += self.dt_s;
            let span = step.to_n - step.from_n;
            let done = (s.thrust_n - step.from_n) / span;
            if done >= 0.9 && step.risen_s.is_none() {
                step.risen_s = Some(step.since_s);
            }
            if (done - 1.0).abs() > 0.05 {
                step.outside_s = step.since_s;
            }
            step.beyond = step.beyond.max(done - 1.0);
            if step.since_s >= STEP_WINDOW_S {
                self.close();
            }
        }
    }

    /// A step counts if it was held for half a second; what was not reached counts as the whole time.
    pub(super) fn close(&mut self) {
        let Some(step) = self.under_way.take() else { return };
        if step.since_s < 0.5 || (step.to_n - step.from_n).abs() < 0.05 * self.scale_n {
            return;
        }
        self.rises.push(step.risen_s.unwrap_or(step.since_s));
        self.settles.push(step.outside_s);
        self.overshoots.push(100.0 * step.beyond);
    }
}
