"""What a printed part does under load: pulled as a bar of slices, or as a solid on cut cells."""
