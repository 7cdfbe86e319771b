"""The simulation study of van 't Veld et al. 2018, and the estimators against each other."""
