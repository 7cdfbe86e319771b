"""The subject's 2-D feedback screen and the operator's page, served to any browser."""
