"""From records to parameters with their confidence: excitation, frequency response, fit, what data cannot tell."""
