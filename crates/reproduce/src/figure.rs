//! Figures as data: axes and series. Who shows them decides how they are drawn.

/// How a series is meant to be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line through the points.
    Line,
    /// A dashed line.
    Dashed,
    /// A dot a point.
    Dots,
}

/// One series.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; empty for none.
    pub name: String,
    /// How it is drawn.
    pub mark: Mark,
    /// Points (x, y), in the units that the figure's axes name.
    pub points: Vec<(f64, f64)>,
}

impl Series {
    /// A series from two columns.
    pub(crate) fn new(name: impl Into<String>, mark: Mark, x: &[f64], y: &[f64]) -> Self {
        Self { name: name.into(), mark, points: x.iter().copied().zip(y.iter().copied()).collect() }
    }
}

/// A figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Words under it.
    pub caption: String,
    /// Name and unit of the x axis, for example `time [s]`.
    pub x: String,
    /// Name and unit of the y axis.
    pub y: String,
    /// What is drawn, first at the back.
    pub series: Vec<Series>,
}

impl Figure {
    /// A figure with axis titles.
    pub(crate) fn new(caption: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        Self { caption: caption.into(), x: x.into(), y: y.into(), series: Vec::new() }
    }

    /// Adds a series.
    pub(crate) fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }
}
