//! The worst stretch of a run, kept to be shown.

use super::Sample;

/// Length of a window whose plot may be shown, s.
const WINDOW_S: f64 = 8.0;
/// Samples a second kept for plots.
const PLOT_HZ: f64 = 100.0;

/// One point of a plot: time, reference, thrust, speed, flow, estimated flow, current.
pub type Point = [f32; 7];

/// The worst stretch of a run.
#[derive(Clone, Debug, Default)]
pub struct Window {
    /// Root mean square of the thrust error in it, N.
    pub rms_n: f64,
    /// What happened.
    pub points: Vec<Point>,
}

/// Window after window, and the worst so far.
pub(super) struct Worst {
    dt_s: f64,
    plot_every: u64,
    seen: u64,
    window: Window,
    squares: f64,
    ticks: u64,
    worst: Window,
}

impl Worst {
    /// For a tick, s.
    pub(super) fn new(dt_s: f64) -> Self {
        Self {
            dt_s,
            plot_every: (1.0 / (PLOT_HZ * dt_s)).round().max(1.0) as u64,
            seen: 0,
            window: Window::default(),
            squares: 0.0,
            ticks: 0,
            worst: Window::default(),
        }
    }

    /// One tick.
    pub(super) fn tick(&mut self, s: &Sample) {
        if !s.excused {
            self.squares += (s.thrust_n - s.reference_n).powi(2);
        }
        self.ticks += 1;
        if self.seen.is_multiple_of(self.plot_every) {
            self.window.points.push([
                s.time_s as f32,
                s.reference_n as f32,
                s.thrust_n as f32,
                s.shaft_speed_rad_s as f32,
                s.flow_m_s as f32,
                s.flow_estimate_m_s as f32,
                s.current_a as f32,
            ]);
        }
        self.seen += 1;
        if self.ticks as f64 * self.dt_s >= WINDOW_S {
            self.window.rms_n = (self.squares / self.ticks as f64).sqrt();
            if self.window.rms_n > self.worst.rms_n {
                std::mem::swap(&mut self.worst, &mut self.window);
            }
            self.window.points.clear();
            (self.squares, self.ticks) = (0.0, 0);
        }
    }

    /// The worst window; of a run shorter than one, what there is.
    pub(super) fn finish(self) -> Window {
        if self.worst.points.is_empty() { self.window } else { self.worst }
    }
}
