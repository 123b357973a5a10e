//! A histogram of the lateness of ticks, with four bins per decade.

/// Upper edge of the first bin of the histogram of lateness, us.
const FIRST_US: f64 = 0.1;
/// Number of bins of the histogram in each decade of lateness.
const PER_DECADE: f64 = 4.0;
/// Number of bins of the histogram of lateness. The bins cover lateness up to one second.
pub(crate) const BINS: usize = 29;

/// A histogram of lateness: how many samples started late by how much. The first bin counts every
/// lateness below 0.1 us, and the last one every lateness above its lower edge.
#[derive(Clone, Debug, Default)]
pub(crate) struct Histogram {
    counts: [u64; BINS],
    total: u64,
}

impl Histogram {
    pub(crate) fn add(&mut self, lateness_us: f64) {
        let bin = ((lateness_us / FIRST_US).log10() * PER_DECADE).floor() + 1.0;
        // For zero lateness the logarithm is minus infinity, which goes into the first bin.
        self.counts[(bin.max(0.0) as usize).min(BINS - 1)] += 1;
        self.total += 1;
    }

    pub(crate) const fn counts(&self) -> &[u64; BINS] {
        &self.counts
    }

    pub(crate) const fn total(&self) -> u64 {
        self.total
    }

    /// Returns the upper edge of the bin with this index, us.
    pub(crate) fn edge(bin: usize) -> f64 {
        FIRST_US * 10_f64.powf(bin as f64 / PER_DECADE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lateness_has_its_bin() {
        let mut histogram = Histogram::default();
        for (us, bin) in [(0.0, 0), (0.05, 0), (0.11, 1), (1.05, 5), (99.0, 12), (1e9, BINS - 1)] {
            let before = histogram.counts()[bin];
            histogram.add(us);
            assert_eq!(histogram.counts()[bin], before + 1, "{us} us");
            if bin > 0 && bin < BINS - 1 {
                assert!(Histogram::edge(bin - 1) <= us && us < Histogram::edge(bin), "{us} us");
            }
        }
        assert_eq!(histogram.total(), 6);
    }
}
