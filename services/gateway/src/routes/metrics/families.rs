//! Metric families, put together one value at a time.

use std::collections::BTreeMap;

use kort_proto::messages::{LATENESS_BOUNDS_NS, Timing};
use prometheus::proto::{Bucket, Counter, Gauge, Histogram, LabelPair, Metric, MetricFamily, MetricType};

/// Metric families by name, in the order of names.
#[derive(Default)]
pub struct Families(BTreeMap<String, MetricFamily>);

impl Families {
    /// A value that goes up and down; one that is not finite is left out.
    pub fn gauge(&mut self, name: &str, help: &str, labels: &[(&str, &str)], value: f64) {
        if value.is_finite() {
            let mut gauge = Gauge::default();
            gauge.set_value(value);
            self.add(name, help, MetricType::GAUGE, labels).set_gauge(gauge);
        }
    }

    /// A value that only grows.
    pub fn counter(&mut self, name: &str, help: &str, labels: &[(&str, &str)], value: f64) {
        let mut counter = Counter::default();
        counter.set_value(value);
        self.add(name, help, MetricType::COUNTER, labels).set_counter(counter);
    }

    /// A loop's lateness.
    pub fn lateness(&mut self, name: &str, help: &str, labels: &[(&str, &str)], timing: &Timing) {
        let buckets = LATENESS_BOUNDS_NS.iter().map(|bound| *bound as f64 * 1e-9).zip(timing.histogram);
        let count = timing.histogram.iter().sum();
        self.histogram(name, help, labels, buckets, count, timing.lateness_sum_ns as f64 * 1e-9);
    }

    /// `buckets` are upper bounds with their counts, not cumulative.
    pub fn histogram(
        &mut self,
        name: &str,
        help: &str,
        labels: &[(&str, &str)],
        buckets: impl Iterator<Item = (f64, u64)>,
        count: u64,
        sum: f64,
    ) {
        let mut below = 0;
        let buckets = buckets.map(|(bound, count)| {
            below += count;
            let mut bucket = Bucket::default();
            bucket.set_upper_bound(bound);
            bucket.set_cumulative_count(below);
            bucket
        });
        let mut histogram = Histogram::default();
        histogram.set_bucket(buckets.collect());
        histogram.set_sample_count(count);
        histogram.set_sample_sum(sum);
        self.add(name, help, MetricType::HISTOGRAM, labels).set_histogram(histogram);
    }

    fn add(&mut self, name: &str, help: &str, kind: MetricType, labels: &[(&str, &str)]) -> &mut Metric {
        let family = self.0.entry(name.to_owned()).or_insert_with(|| {
            let mut family = MetricFamily::default();
            family.set_name(format!("kort_{name}"));
            family.set_help(help.to_owned());
            family.set_field_type(kind);
            family
        });
        let pairs = labels.iter().map(|(name, value)| {
            let mut pair = LabelPair::default();
            pair.set_name((*name).to_owned());
            pair.set_value((*value).to_owned());
            pair
        });
        let metrics = family.mut_metric();
        metrics.push(Metric::from_label(pairs.collect()));
        metrics.last_mut().expect("just pushed")
    }

    /// What the encoder takes.
    pub fn into_families(self) -> Vec<MetricFamily> {
        self.0.into_values().collect()
    }
}
