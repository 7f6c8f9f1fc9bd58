"""What a model corrects beyond harmonics: forms, terms, and the corrector that holds state."""
