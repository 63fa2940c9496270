"""The methods of this project as users see them: descriptions, with the equations they stand for."""
