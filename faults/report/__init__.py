"""Statistics, tables, drawings and the HTML page of a campaign."""
