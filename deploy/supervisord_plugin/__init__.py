"""Code that runs in supervisord's own interpreter; only supervisord imports it."""
