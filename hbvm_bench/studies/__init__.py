"""One folder a study: what it runs beyond a campaign, and its page."""
