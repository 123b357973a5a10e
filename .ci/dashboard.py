#!/usr/bin/env python3
"""Checks the queries of a Grafana dashboard: `dashboard.py DASHBOARD PROMETHEUS PAGE`.

Every metric that a query names is on the server's metrics page, every metric of the page is in some query, and
Prometheus, which scrapes that page, answers every query with at least one series.
"""

import json
import re
import sys
import time
import urllib.error
import urllib.parse
import urllib.request

PATIENCE_S = 60


def ask(prometheus, query):
    """The series that answer a query, or None while Prometheus is not ready to answer."""
    url = f"{prometheus}/api/v1/query?{urllib.parse.urlencode({'query': query})}"
    try:
        with urllib.request.urlopen(url, timeout=10) as answer:
            return json.load(answer)["data"]["result"]
    except urllib.error.HTTPError as error:
        if error.code == 503:
            return None
        sys.exit(f"{query}\n{error.read().decode()}")
    except urllib.error.URLError:
        return None


def main(dashboard, prometheus, page):
    with open(dashboard, encoding="utf-8") as file:
        panels = json.load(file)["panels"]
    queries = [target["expr"] for panel in panels for target in panel["targets"]]
    with open(page, encoding="utf-8") as file:
        served = set(re.findall(r"^(hbot_\w+)", file.read(), re.MULTILINE))
    named = set(re.findall(r"\bhbot_\w+", " ".join(queries)))
    if named - served:
        sys.exit(f"queries name metrics that the server does not have: {sorted(named - served)}")
    if served - named:
        sys.exit(f"no query shows: {sorted(served - named)}")
    # Grafana puts in a time of at least four scrapes, and the servers that are chosen.
    queries = [query.replace("$__rate_interval", "10s").replace("$instance", ".+") for query in queries]
    deadline = time.monotonic() + PATIENCE_S
    for query in queries:
        while not ask(prometheus, query):
            if time.monotonic() > deadline:
                sys.exit(f"no answer to {query}")
            time.sleep(0.1)
    print(f"{len(queries)} queries in {len(panels)} panels show all {len(served)} metrics")


if __name__ == "__main__":
    main(*sys.argv[1:])
