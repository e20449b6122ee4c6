//! What changes need of a recording's columns.

use kort_recording::Recording;

/// Commands, likeliest driver first; a measured current drives where none of them is there.
const COMMANDS: [&str; 4] = ["current_cmd_a", "voltage_cmd_v", "duty_cmd", "current_a"];

/// Column that drives, if it varies.
pub fn driver(recording: &Recording) -> Option<&'static str> {
    COMMANDS
        .into_iter()
        .find(|name| recording.column(name).is_some_and(|cells| full_scale(cells) > 0.0 && varies(cells)))
}

/// Whether a column takes more than one value.
pub fn varies(cells: &[f64]) -> bool {
    let mut seen = cells.iter().filter(|cell| cell.is_finite());
    let first = seen.next();
    seen.any(|cell| Some(cell) != first)
}

/// Cells of a column, to be changed.
pub fn cells<'a>(recording: &'a mut Recording, name: &str) -> Option<&'a mut Vec<f64>> {
    recording.columns.iter_mut().find(|column| column.name == name).map(|column| &mut column.values)
}

/// Largest magnitude but for the topmost two hundredths.
pub fn full_scale(cells: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = cells.iter().filter(|cell| cell.is_finite()).map(|cell| cell.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() - sizes.len().min(1 + sizes.len() / 50)).copied().unwrap_or(0.0)
}

/// A column without empty cells: each holds what came before it.
pub fn held(cells: &[f64]) -> Vec<f64> {
    let mut last = cells.iter().copied().find(|cell| cell.is_finite()).unwrap_or(0.0);
    cells
        .iter()
        .map(|cell| {
            if cell.is_finite() {
                last = *cell;
            }
            last
        })
        .collect()
}

/// Value of held samples at an instant: what stood there then.
pub fn held_at(time_s: &[f64], cells: &[f64], at_s: f64) -> f64 {
    let next = time_s.partition_point(|t| *t <= at_s + 1e-9);
    cells[next.saturating_sub(1)]
}

/// Value between samples, in proportion; the ends stand beyond them.
pub fn between(time_s: &[f64], cells: &[f64], at_s: f64) -> f64 {
    let next = time_s.partition_point(|t| *t <= at_s);
    if next == 0 {
        return cells[0];
    }
    if next == time_s.len() {
        return cells[next - 1];
    }
    let share = (at_s - time_s[next - 1]) / (time_s[next] - time_s[next - 1]);
    cells[next - 1] + share * (cells[next] - cells[next - 1])
}

/// Usual time between rows, s.
pub fn row_s(recording: &Recording) -> f64 {
    let mut steps: Vec<f64> = recording.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// A first-order lag over the samples of a column, exact where it stands between them.
pub fn lagged(time_s: &[f64], cells: &[f64], lag_s: f64) -> Vec<f64> {
    let mut value = cells.iter().copied().find(|cell| cell.is_finite()).unwrap_or(0.0);
    let mut last_s = time_s.first().copied().unwrap_or(0.0);
    time_s
        .iter()
        .zip(cells)
        .map(|(time, cell)| {
            if cell.is_nan() {
                return f64::NAN;
            }
            let keep = (-(time - last_s) / lag_s).exp();
            value = cell + (value - cell) * keep;
            last_s = *time;
            value
        })
        .collect()
}
