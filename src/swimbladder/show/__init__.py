"""What users see of results: pictures (`plots`), pages and their words (`report`, `templates`)."""
