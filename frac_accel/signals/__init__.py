"""Operations on plain arrays: filters, spectra, errors; they know no model."""
