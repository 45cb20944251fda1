"""Pages, contact sheets, tables and exports of results; reads artifacts, makes none that a stage needs."""
