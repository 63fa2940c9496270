"""The pages on the problems: what each is, with a picture; made by code from the problems themselves."""
