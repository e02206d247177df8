"""Policies that learn: settings, learners, bundles."""
