"""From a lab's files to curves grouped by material, and from results to files."""
