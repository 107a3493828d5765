"""What spectra tell without a model: excitation, frequency response, its points."""
