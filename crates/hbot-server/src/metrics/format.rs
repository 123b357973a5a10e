//! Chooses the format of the metrics page from the `Accept` of a request (RFC 9110, 12.5.1).

/// A text format that Prometheus reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    /// OpenMetrics 1.0.0.
    OpenMetrics,
    /// The format before it, which `promtool check metrics` reads.
    Text,
}

impl Format {
    /// Returns the format that a request prefers by the value of its header `Accept`, and
    /// OpenMetrics if it does not prefer one.
    pub(super) fn preferred(accept: &str) -> Self {
        let open = weight(accept, "application/openmetrics-text", "1.0.0");
        let text = weight(accept, "text/plain", "0.0.4");
        if text > open { Self::Text } else { Self::OpenMetrics }
    }

    /// Returns the content type of a page in this format.
    pub(super) const fn content_type(self) -> &'static str {
        match self {
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
            Self::Text => "text/plain; version=0.0.4; charset=utf-8",
        }
    }
}

/// Returns the weight, 0 to 1, that `accept` gives to a media type in this version. The most
/// specific of the ranges that contain it counts.
fn weight(accept: &str, media: &str, version: &str) -> f32 {
    let group = media.split('/').next().unwrap_or_default();
    let mut found = (0, 0.0);
    for range in accept.split(',') {
        let mut words = range.split(';').map(str::trim);
        let specific = match words.next() {
            Some(name) if name.eq_ignore_ascii_case(media) => 3,
            Some(name) if name.strip_suffix("/*").is_some_and(|name| name.eq_ignore_ascii_case(group)) => 2,
            Some("*/*") => 1,
            _ => continue,
        };
        let (mut weight, mut right) = (1.0, true);
        for (name, value) in words.filter_map(|word| word.split_once('=')) {
            match name.trim() {
                "q" => weight = value.trim().parse().unwrap_or(0.0),
                "version" => right = value.trim().trim_matches('"') == version,
                _ => {}
            }
        }
        if right && (specific > found.0 || specific == found.0 && weight > found.1) {
            found = (specific, weight);
        }
    }
    found.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_gets_the_format_that_it_prefers() {
        // What Prometheus 2.42 and 3 send.
        let prometheus_2 = "application/openmetrics-text;version=1.0.0,application/openmetrics-text;version=0.0.1;q=0.75,\
                            text/plain;version=0.0.4;q=0.5,*/*;q=0.1";
        let prometheus_3 = "application/openmetrics-text;version=1.0.0;escaping=allow-utf-8;q=0.5,\
                            application/openmetrics-text;version=0.0.1;q=0.4,text/plain;version=1.0.0;escaping=allow-utf-8;q=0.3,\
                            text/plain;version=0.0.4;q=0.2,*/*;q=0.1";
        for accept in ["", "*/*", prometheus_2, prometheus_3, "text/html", "application/*, text/plain;q=0.9"]
        {
            assert_eq!(Format::preferred(accept), Format::OpenMetrics, "{accept}");
        }
        for accept in [
            "text/plain;version=0.0.4",
            "text/plain; version=\"0.0.4\"",
            "text/plain",
            "Text/Plain, */*;q=0.1",
            "application/openmetrics-text;q=0.3, text/plain;version=0.0.4",
            "text/*;q=0.2",
        ] {
            assert_eq!(Format::preferred(accept), Format::Text, "{accept}");
        }
        // A newer version of the text format, which this page does not have.
        assert_eq!(Format::preferred("text/plain;version=1.0.0"), Format::OpenMetrics);
    }
}
